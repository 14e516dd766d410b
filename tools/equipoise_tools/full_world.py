"""python -m equipoise_tools.full_world [--robots N] [--first-robot N] [--write]

The firmware in the world `full` beside its controller on true states, and which effect it is: the tables of
docs/reports/full-world.md. Trials that are in --out already are not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

from .paths import UserError, repository_root
from .trials import run_trials

PAGE = Path("docs/reports/full-world.md")
BEGIN, END = "<!-- tables: python -m equipoise_tools.full_world --write -->\n", "<!-- end -->\n"
POINTS = {
    "mbbr": ((0.0, 0.0), (0.0, 0.3), (1.0, 0.2), (3.0, 0.2)),
    "edumip": ((0.0, 0.3), (0.5, 0.3), (1.0, 0.2), (1.5, 0.2), (3.0, 0.2)),
}
# Settings, and estimator if not the default.
KINDS = {
    "true states": ({"safety.detection": "false"}, "truth"),
    "nothing judged": ({"safety.detection": "false"}, ""),
    "firmware": ({}, ""),
}
# Upright with the firmware of a8d827e, of the robots 1 to 100 (eduMIP), 1 to 40 (MBBR).
BASELINE = {
    ("mbbr", 0.0, 0.0): "0 of 40", ("mbbr", 1.0, 0.2): "0 of 40", ("mbbr", 3.0, 0.2): "0 of 40",
    ("edumip", 0.0, 0.3): "26 of 100", ("edumip", 0.5, 0.3): "10 of 100", ("edumip", 1.0, 0.2): "7 of 100",
    ("edumip", 1.5, 0.2): "11 of 100", ("edumip", 3.0, 0.2): "9 of 100",
}  # fmt: skip
DURATION_S = 20.0

# Effects of the MBBR's world and what turns each off; keys below world.full.
_NONE = "[0,0,0]"
EFFECTS = {
    "wheel slip": {"disturbance.wheel_grip": "0"},
    "friction that changes": {"disturbance.friction_scale": "[1,1]"},
    "slip on the floor": {"disturbance.floor_grip": "0"},
    "pushes": {"random_pushes.every_s": "0"},
    "stiction": {"disturbance.static_ratio": "1"},
    "viscous friction": {"disturbance.extra_viscous_N_m_s": "0"},
    "yaw friction by direction": {"disturbance.yaw_friction_scale": "[1,1]"},
    "torque imbalance": {"disturbance.wheel_torque_scale": "[1,1,1]"},
    "bridge delays": {"disturbance.bridge_on_delay_s": "0", "disturbance.bridge_off_delay_s": "0"},
    "diode drop": {"disturbance.diode_drop_V": "0"},
    "battery": {"battery_V": "8", "battery_resistance_ohm": "0"},
    "backlash": {"disturbance.backlash_rad": "0"},
    "roller tilt": {"disturbance.roller_tilt_rad": "0"},
    "micro-slip": {"disturbance.roller_slip_N_m": "0"},
    "robot unlike its model": {
        f"actual.{name}_scale": "1"
        for name in (
            *("body_mass", "com_height", "body_inertia", "ball_mass"),
            *("ball_radius", "wheel_radius", "torque", "back_emf"),
        )
    },
    "mass centre": {"disturbance.com_offset_rad": "[0,0]"},
    "IMU mount": {"disturbance.imu_misalignment_rad": _NONE},
    "vibration of the gyro": {"vibration.gyro_sigma_rad_s": _NONE},
    "vibration of the accelerometer": {"vibration.accel_sigma_m_s2": _NONE},
    "chip noise": {"gyro_sigma_rad_s": "0", "accel_sigma_m_s2": "0"},
    "IMU bias": {"gyro_bias_sigma_rad_s": "0", "accel_bias_sigma_m_s2": "0"},
    "warm gyro": {"disturbance.gyro_drift_rad_s_K": _NONE},
    "gyro scale": {"disturbance.gyro_scale_error": _NONE},
    "accelerometer scale": {"disturbance.accel_scale_error": _NONE},
    "IMU low-pass": {"disturbance.imu_low_pass": "0"},
    "repeated samples": {"disturbance.imu_repeat_share": "0"},
    "missed ticks": {"disturbance.missed_tick_share": "0"},
    "actuation delay": {"disturbance.actuation_delay_ticks": "0"},
    "slope": {"disturbance.floor_slope_rad": "[0,0]"},
    "floor waves": {"floor.wave_rad": "0"},
    "sills": {"floor.sill_m": "0"},
    "joints": {"floor.joint_m": "0"},
    "rolling resistance": {"disturbance.rolling_resistance": "0"},
}


def settings_without(effects: list[str]) -> dict[str, str]:
    return {f"world.full.{key}": value for name in effects for key, value in EFFECTS[name].items()}


class Trials:
    def __init__(self, out: Path, robots: range, draw: bool = False):
        self.out, self.robots, self.draw = out, robots, draw

    def run(self, robot: str, kind: str, point: tuple[float, float], off: str = "") -> list[dict]:
        """`off`: "", "without NAME" or "alone NAME+NAME"."""
        word, _, names = off.partition(" ")
        named = names.split("+")
        effects = {"": [], "without": named, "alone": [e for e in EFFECTS if e not in named]}[word]
        sets, estimator = KINDS[kind]
        label = f"{robot}-{kind}-{point[0]:g}-{point[1]:g}-{off}-{self.robots[0]}-{self.robots[-1]}"
        done = self.out / f"{label.replace(' ', '_')}.json"
        if not done.exists() and self.draw:
            return []
        if not done.exists():
            asked = [
                {"robot": n, "seed": n, "yaw_hz": point[0], "drive_mps": point[1]}
                | {"duration_s": DURATION_S, "estimator": estimator}
                for n in self.robots
            ]
            rows = run_trials(f"config/{robot}.toml", asked, sets | settings_without(effects))
            unfinished = done.with_suffix(".part")
            unfinished.write_text(json.dumps({"trials": rows}))
            unfinished.rename(done)
        found: list[dict] = json.loads(done.read_text())["trials"]
        return found


def upright(rows: list[dict]) -> str:
    return str(sum(not row["fell"] for row in rows)) if rows else ""


def points_table(trials: Trials) -> list[str]:
    lines = [
        "| robot, yaw Hz, m/s | controller on true states | firmware, nothing judged | firmware "
        "| healthy sensor excluded | lost by | firmware a8d827e |",
        "|---|---|---|---|---|---|---|",
    ]
    for robot, points in POINTS.items():
        for point in points:
            rows = {kind: trials.run(robot, kind, point) for kind in KINDS}
            judged = rows["firmware"]
            lost = Counter((row["reasons"] or [row["ended"]])[0] for row in judged if row["fell"])
            cells = [f"{robot}, {point[0]:g}, {point[1]:g}", *(upright(rows[kind]) for kind in KINDS)]
            cells += [str(sum(row["excluded_healthy"] for row in judged))]
            cells += [", ".join(f"{name} {n}" for name, n in lost.most_common(4))]
            cells += [BASELINE.get((robot, *point), "")]
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def effects_table(trials: Trials, names: list[str]) -> list[str]:
    lines = [
        "| effect | true states, all but it | nothing judged, all but it | firmware, all but it "
        "| firmware, it alone | firmware, it and wheel slip |",
        "|---|---|---|---|---|---|",
    ]
    stand = (0.0, 0.0)
    columns = [(kind, "without {}") for kind in KINDS]
    columns += [("firmware", "alone {}"), ("firmware", "alone wheel slip+{}")]
    base = [upright(trials.run("mbbr", kind, stand)) for kind in KINDS]
    lines.append(f"| all on | {' | '.join(base)} | | |")
    for name in names:
        cells = [upright(trials.run("mbbr", kind, stand, how.format(name))) for kind, how in columns]
        if any(cells):
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="full_world", description=__doc__.splitlines()[2])
    parser.add_argument("--first-robot", type=int, default=901)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--effects", nargs="*", choices=list(EFFECTS), default=list(EFFECTS))
    parser.add_argument("--out", type=Path, default=repository_root() / "build" / "full-world")
    parser.add_argument("--draw", action="store_true", help="run nothing: what --out has, else blank")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE}")
    given = parser.parse_args(words)
    given.out.mkdir(parents=True, exist_ok=True)
    trials = Trials(given.out, range(given.first_robot, given.first_robot + given.robots), given.draw)
    try:
        tables = [*points_table(trials), "", "MBBR standing:", "", *effects_table(trials, given.effects)]
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    text = "\n".join(tables) + "\n"
    if given.write:
        page = repository_root() / PAGE
        before, _, rest = page.read_text().partition(BEGIN)
        page.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.partition(END)[2]}")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
