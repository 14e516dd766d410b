"""Worlds that [T]'s robot may have stood in, and how near runs in one come to what [T] says.

[T]'s own filters and gains run in a world under the conditions of Tables 6.1 to 6.3 and Fig. 6.25 to 6.32;
tools/lab world looks for the worlds, and the conventions of the prints, whose runs agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from . import published
from .experiments.control import CONDITIONS
from .experiments.runs import NO_GATES
from .experiments.table_6_1 import WITHIN
from .inference import Parameter
from .trials import run_trials

DURATION_S = 15.0
LOST_S = (6.0, 12.0)  # Fig. 6.28: "slowly lost balance after 8 seconds", as experiments/control.py has it
FAR = 5.0  # no statistic is farther off than this: one that cannot be met must not drown the others
OPEN = {**NO_GATES, "safety.detection": "false", "safety.max_fall_rad": 10.0}  # [T] has no detector
W = "world.nominal."


# Ranges: twice what docs/disturbances.md gives for robots as built, and what [T] leaves open.
WORLD = (
    Parameter("Coulomb friction over identified", 0.5, 2.0),
    Parameter("viscous friction beside it", 0.0, 0.008, unit="N m s"),
    Parameter("motor torque over identified", 0.8, 1.3),
    Parameter("back-EMF over identified", 0.3, 1.3),
    Parameter("delay of the loop", 0, 14, whole=True, unit="ms"),
    Parameter("IMU low-pass setting", 0, 6, whole=True),
    Parameter("gyro vibration", 0.002, 0.1, log=True, unit="rad/s"),
    Parameter("accelerometer vibration", 0.1, 3.0, log=True, unit="m/s2"),
    Parameter("IMU mount about x", -0.06, 0.06, unit="rad"),
    Parameter("IMU mount about y", -0.06, 0.06, unit="rad"),
    Parameter("wheel grip (from 0.9: no slip)", 0.4, 1.4),
    Parameter("roller tilt", 0.0, 0.094, unit="rad"),
    Parameter("backlash", 0.0, 0.06, unit="rad"),
)
MOCAP = (
    Parameter("motion capture's tilt error", 0.0, 0.017, unit="rad"),
    Parameter("motion capture's speed noise", 0.0, 0.083, unit="m/s"),
)
PRINTS = (
    Parameter("sign of (6.13)", choices=("as printed", "turned")),
    Parameter("rates in (6.7)", choices=("Euler", "body")),
    Parameter("filters' frame, Fig. 6.2", choices=("yaw", "inertial")),
    Parameter("back-EMF fed forward", choices=("no", "yes")),
    Parameter("commands' acceleration", choices=("step", "limited")),
    Parameter("gains of Table 6.1", choices=("(6.29)", "ours")),
)
PARAMETERS = (*WORLD, *MOCAP, *PRINTS)


def world_settings(at: dict) -> dict[str, object]:
    d = W + "disturbance."
    gyro, accel = at["gyro vibration"], at["accelerometer vibration"]
    grip = at["wheel grip (from 0.9: no slip)"]
    return {
        d + "coulomb_scale": at["Coulomb friction over identified"],
        d + "static_ratio": 1.25,
        d + "extra_viscous_N_m_s": at["viscous friction beside it"],
        d + "wheel_torque_scale": "[1.0575, 0.9425, 1.0]",  # [T] section 5.3
        d + "sensor_latency_ticks": at["delay of the loop"] // 5,  # of 5 ms
        d + "actuation_latency_steps": at["delay of the loop"] % 5,  # of 1 ms
        d + "imu_low_pass": at["IMU low-pass setting"],
        d + "imu_misalignment_rad": f"[{at['IMU mount about x']}, {at['IMU mount about y']}, 0]",
        d + "wheel_grip": grip if grip < 0.9 else 0.0,
        d + "roller_tilt_rad": at["roller tilt"],
        d + "backlash_rad": at["backlash"],
        W + "actual.torque_scale": at["motor torque over identified"],
        W + "actual.back_emf_scale": at["back-EMF over identified"],
        W + "vibration.gyro_sigma_rad_s": f"[{gyro}, {gyro}, {gyro}]",
        W + "vibration.accel_sigma_m_s2": f"[{accel}, {accel}, {accel}]",
    }


def print_settings(at: dict) -> dict[str, object]:
    of_t = published.control()
    keys = {
        "sign of (6.13)": ("reference.slc_sign",),
        "rates in (6.7)": ("reference.rate_feedback",),
        "filters' frame, Fig. 6.2": ("reference.filter_frame",),
        "back-EMF fed forward": ("controller.thesis.yaw_feedforward_s",),
        "commands' acceleration": (
            "reference.max_acceleration_m_s2",
            "reference.max_yaw_acceleration_rad_s2",
        ),
    }
    printed = [key for p in PRINTS[:5] if at[p.name] == p.choices[0] for key in keys[p.name]]
    return {"friction.compensation": of_t["friction.compensation"]} | {key: of_t[key] for key in printed}


@dataclass(frozen=True)
class Row:
    """A driving condition of [T]. `stood`: to the end; else lost within LOST_S. `printed`: RMS errors."""

    name: str
    group: str
    yaw_hz: float
    drive_mps: float
    estimator: str = "ekf13_published"
    stood: bool = True
    printed: dict[str, float] = field(default_factory=dict)

    def quantities(self) -> tuple[str, ...]:
        return ("upright_s", *self.printed)

    def off(self, quantity: str, ran: dict) -> float:
        """How far a run is from [T]'s: up to 1 agrees."""
        value = ran[quantity]
        if quantity != "upright_s":
            if value is None or ran["upright_s"] < DURATION_S:
                return FAR
            return min(FAR, abs(math.log(value / self.printed[quantity])) / math.log(1 + WITHIN))
        low, high = (DURATION_S, DURATION_S) if self.stood else LOST_S
        if low <= value <= high:
            return 0.0
        return 2.0 if value > high else 1.0 + (FAR - 1.0) * (1.0 - value / low)


def rows_of_t() -> tuple[Row, ...]:
    def said(yaw_hz: float, drive_mps: float) -> str:
        return f"{yaw_hz:g} Hz, {100 * drive_mps:g} cm/s"

    found = [
        Row(
            f"Table 6.1, {said(hz, drive)}", "6.1", hz, drive,
            printed={"attitude_rmse_rad": tilt, "ball_speed_rmse_m_s": speed},
        )
        for hz, drive, tilt, speed in published.table()["Table 6.1"]["rows"]
    ]  # fmt: skip
    found += [Row(f"Table 6.2, {hz:g} Hz", "6.2", hz, 0.0) for hz in published.table()["Table 6.2"]["yaw_hz"]]
    for i, condition in enumerate(CONDITIONS):
        stood = i + 1 < len(CONDITIONS)
        found += [Row(f"Fig. 6.{25 + i}, EKF, {said(*condition)}", "6.3", *condition, stood=stood)]
        found += [Row(f"Fig. 6.{29 + i}, DMP+KF, {said(*condition)}", "6.3", *condition, "kf_attitude")]
    return tuple(found)


GROUPS = {  # [T]'s filters and gains
    "6.1": ("(6.28)", "(6.29)"),
    "6.2": ("(6.30)", "Table 6.2"),
    "6.3": ("(6.31)", "Table 6.3"),
}


def trials(settings: dict[str, object], asked: list[dict]) -> list[dict]:
    """Runs of `equipoise trials`, with upright_s."""
    found = run_trials("config/mbbr.toml", asked, settings, jobs=1)
    for row in found:
        row["upright_s"] = row["fell_at_s"] if row["fell"] else row["duration_s"]
    return found


QUANTITIES = ("upright_s", "attitude_rmse_rad", "ball_speed_rmse_m_s")


def run_rows(rows: tuple[Row, ...], at: dict, seed: int) -> dict[str, dict]:
    """Row's name -> its quantities, as motion capture would see them."""
    found = {}
    for group, (noise, gains) in GROUPS.items():
        here = [row for row in rows if row.group == group]
        if not here:
            continue
        ours = group == "6.1" and at["gains of Table 6.1"] == "ours"
        settings = {
            **OPEN,
            **published.ekf(noise),
            **published.kf(),
            **print_settings(at),
            **world_settings(at),
        }
        settings |= {} if ours else published.gains(gains)
        asked = [
            {"yaw_hz": row.yaw_hz, "drive_mps": row.drive_mps, "estimator": row.estimator, "seed": seed}
            | {
                "controller": "scheduled" if ours else "thesis",
                "duration_s": DURATION_S,
                "fidelity": "nominal",
            }
            for row in here
        ]
        for row, ran in zip(here, trials(settings, asked), strict=True):
            kept = {quantity: ran[quantity] for quantity in QUANTITIES}
            for quantity, noise_of in zip(QUANTITIES[1:], MOCAP, strict=True):
                if kept[quantity] is not None:
                    kept[quantity] = math.hypot(kept[quantity], at[noise_of.name])
            found[row.name] = kept
    return found
