"""From bench to run: unknown motors and friction are identified, the files written, and the robot runs "
"with them."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .data import Data, Ran
from .framework import Result
from .runs import MBBR, MIP, Case, Lab, equipoise_json, rows_of

COVERS = ("Identification to run",)
FIRST_ROBOT = 201
FLYWHEEL_KG_M2 = 2e-3
RATIO = 1.25  # flywheel of the friction rig over the ball
RIG_FLYWHEEL_KG_M2 = 1.5e-3
SAMPLE_S, STEP_S = 0.005, 0.0005
COUNT_RAD = 2 * np.pi / 10000  # US Digital E6-2500, four edges: [T] 4.5.1
GEARING = (0.032 / 0.0125) ** 2  # wheels to ball
SPREAD = {"R": 0.10, "k": 0.10, "mu_c": 0.25, "mu_v": 0.5}


@dataclass(frozen=True)
class Kind:
    """Nominal values of a robot, [motor] and [robot] of its configuration."""

    config: str
    nominal_V: float
    R: float
    k: float
    mu_c: float
    mu_v: float
    options: dict
    compared: str  # the error by which runs are compared


KINDS = {
    "mbbr": Kind(MBBR, 8.0, 3.385, 0.0742, 0.05265, 0.001056, {"yaw_hz": 0.5, "drive_mps": 0.2},
                 "yaw_frame_speed_rmse_m_s"),
    "mip": Kind(MIP, 7.4, 11.4, 0.185, 0.006, 1e-4, {"yaw_rad_s": 5.0}, "wheel_speed_rmse_rad_s"),
}  # fmt: skip
KNOWING = ("true", "identified", "as shipped")


@dataclass(frozen=True)
class Motor:
    R: float
    k: float
    mu_c: float
    mu_v: float


def drawn(kind: Kind, robot: int) -> Motor:
    random = np.random.default_rng(robot)
    scale = {name: 1 + random.uniform(-width, width) for name, width in SPREAD.items()}
    return Motor(*(getattr(kind, name) * scale[name] for name in ("R", "k", "mu_c", "mu_v")))


def swept(t_s: np.ndarray, low_hz: float, high_hz: float) -> np.ndarray:
    """Sine whose frequency rises to the middle and falls again."""
    half = t_s[-1] / 2
    hz = low_hz + (high_hz - low_hz) * (1 - np.abs(t_s - half) / half)
    return np.sin(2 * np.pi * np.cumsum(hz) * (t_s[1] - t_s[0]))


def turned(drive: np.ndarray, damping: float, mu_c: float, inertia: float) -> np.ndarray:
    """Rate under a torque `drive`, linear damping and dry friction that can hold; a sample per STEP_S."""
    rates = np.empty(drive.size)
    rate, most = 0.0, mu_c * STEP_S / inertia
    for n, torque in enumerate(drive):
        free = rate + STEP_S / inertia * (torque - damping * rate)
        rate = free - np.clip(free, -most, most)
        rates[n] = rate
    return rates


def motor_log(file: Path, motor: Motor, supply_V: float, random: np.random.Generator) -> None:
    """Drive/brake bench: flywheel on the shaft, current sensor with a milliampere of noise."""
    t_s = np.arange(0.0, 30.0, STEP_S)
    u = 0.9 * np.minimum(1.0, 0.2 + t_s / 20) * swept(t_s, 0.3, 1.5)
    rate = turned(
        motor.k * u * supply_V / motor.R, motor.k**2 / motor.R + motor.mu_v, motor.mu_c, FLYWHEEL_KG_M2
    )
    current = (u * supply_V - motor.k * rate) / motor.R
    write_log(file, u, current, supply_V, np.cumsum(rate) * STEP_S, random)


def friction_log(file: Path, motor: Motor, nominal_V: float, random: np.random.Generator) -> None:
    """[T] 5.3: 20 s, 0.1 to 2 Hz, amplitude 3; the current is not measured."""
    t_s = np.arange(0.0, 20.0, STEP_S)
    u = 3.0 * swept(t_s, 0.1, 2.0)
    k1, k2 = k1_of(motor, nominal_V), motor.k**2 / motor.R * GEARING
    rate = turned(k1 * u, k2 + motor.mu_v, motor.mu_c, RIG_FLYWHEEL_KG_M2 / RATIO**2)
    write_log(file, u, np.full(u.size, np.nan), nominal_V, np.cumsum(rate) * STEP_S / RATIO, random)


def write_log(file, u, current_A, supply_V, angle_rad, random) -> None:
    every = round(SAMPLE_S / STEP_S)

    def means(values: np.ndarray) -> np.ndarray:
        return values.reshape(-1, every).mean(axis=1)

    angle = np.round(angle_rad[every - 1 :: every] / COUNT_RAD) * COUNT_RAD
    noisy = means(current_A) + random.normal(0.0, 1e-3, angle.size)
    rows = np.column_stack(
        [SAMPLE_S * (1 + np.arange(angle.size)), means(u), noisy, np.full(angle.size, supply_V), angle]
    )
    head = "t_s,u,current_A,supply_V,angle_rad"
    np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.9g")


def k1_of(motor: Motor, nominal_V: float) -> float:
    return motor.k * nominal_V / motor.R


def identified(name: str, robot: int) -> Motor:
    """By `equipoise identify`, from logs of benches that hold the unknown robot's parts."""
    kind = KINDS[name]
    actual = drawn(kind, robot)
    random = np.random.default_rng([robot, 7])
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "bench.csv"
        motor_log(log, actual, kind.nominal_V, random)
        found = equipoise_json("identify", "motor", log, "--inertia-kg-m2", FLYWHEEL_KG_M2)["estimates"]
        R, k = found["resistance_ohm"]["value"], found["torque_constant_N_m_A"]["value"]
        if name == "mbbr":
            friction_log(log, actual, kind.nominal_V, random)
            k1, k2 = k * kind.nominal_V / R, k**2 / R * GEARING
            found = equipoise_json(
                "identify", "friction", log, "--radius-ratio", RATIO, "--k1-N-m", k1, "--k2-ball-N-m-s", k2
            )["estimates"]
    return Motor(R, k, found["coulomb_friction_N_m"]["value"], found["viscous_friction_N_m_s"]["value"])


def sets(name: str, known: Motor, actual: Motor) -> dict[str, object]:
    """The configuration says `known`; the plant, whose numbers are scales of it, stays `actual`."""
    kind = KINDS[name]
    k2 = known.k**2 / known.R
    world = "world.nominal."
    torque = (actual.k / actual.R) / (known.k / known.R)
    found = {
        "motor.resistance_ohm": known.R,
        "motor.torque_constant_N_m_A": known.k,
        "robot.k1_N_m": k1_of(known, kind.nominal_V),
        "robot.coulomb_friction_N_m": known.mu_c,
        f"{world}actual.torque_scale": torque,
        f"{world}actual.back_emf_scale": actual.k / known.k,
    }
    if name == "mbbr":
        found["robot.k2_ball_N_m_s"] = k2 * GEARING
        found["robot.viscous_friction_N_m_s"] = min(known.mu_v, actual.mu_v)  # the plant only adds to it
        found[f"{world}disturbance.coulomb_scale"] = actual.mu_c / known.mu_c
        found[f"{world}disturbance.extra_viscous_N_m_s"] = max(0.0, actual.mu_v - known.mu_v)
    else:
        found["robot.k2_N_m_s"] = k2
        gains = [0.8 * actual.mu_c / known.mu_c, 1.2 * actual.mu_c / known.mu_c]
        found[f"{world}friction_gain"] = f"[{gains[0]:.6g}, {gains[1]:.6g}]"
    return {key: value if isinstance(value, str) else f"{value:.6g}" for key, value in found.items()}


def measure(lab: Lab) -> Data:
    data = Data()
    for name, kind in KINDS.items():
        for robot in range(FIRST_ROBOT, FIRST_ROBOT + lab.seeds):
            actual, found = drawn(kind, robot), identified(name, robot)
            ran = Ran(world="simulated benches")
            for parameter in ("R", "k", "mu_c"):
                off = 100 * abs(getattr(found, parameter) / getattr(actual, parameter) - 1)
                data.add(name, f"{parameter}_error_percent", off, ran, robot)
            # Of all damping, back-EMF included: what the friction's slope is for.
            gearing = GEARING if name == "mbbr" else 1.0
            total = [m.k**2 / m.R * gearing + m.mu_v for m in (actual, found)]
            data.add(name, "damping_error_percent", 100 * abs(total[1] / total[0] - 1), ran, robot)
            shipped = Motor(kind.R, kind.k, kind.mu_c, kind.mu_v)
            for words, known in zip(KNOWING, (actual, found, shipped), strict=True):
                case = Case(
                    f"{name}, {words}",
                    kind.config,
                    sets(name, known, actual),
                    {**kind.options, "duration_s": 60},
                )
                data.rows += rows_of(case, robot, traced=False).rows
    return data


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="From an unknown robot's bench logs to its run",
        command="equipoise identify motor LOG --inertia-kg-m2 2e-3; equipoise identify friction LOG "
        f"--radius-ratio {RATIO} --k1-N-m K1 --k2-ball-N-m-s K2; equipoise sim --config ...",
        method=f"Robots {FIRST_ROBOT} and on of each type: resistance and torque constant drawn within "
        "10 %, Coulomb "
        "friction within 25 %, viscous friction within 50 % of nominal. Their parts are put on benches "
        "that are "
        "simulated here, not by the firmware's own bench: flywheel on the motor in drive/brake, ball on "
        "the friction "
        "rig; encoder counts, 1 mA of noise. `equipoise identify` finds the parameters; the robot runs "
        "60 s in the "
        "nominal world with what was found, with the true parameters, and with those it ships with. "
        "MBBR: 0.5 Hz and "
        "20 cm/s; eduMIP: 5 rad/s.",
        differs="no counterpart in [T]. `identify motor` writes [motor] only; k1 and k2 of [robot] "
        "follow from it by "
        "k V/R and k²/R and are written here.",
        data=data,
    )
    target = COVERS[0]
    for name, kind in KINDS.items():
        for parameter, limit in (("R", 3.0), ("k", 3.0), ("mu_c", 5.0), ("damping", 5.0)):
            quantity = f"{parameter}_error_percent"
            result.add(target, f"{name}: error of {parameter}", name, quantity, unit="%")
            text = f"{name}: {parameter} found within {limit:g} %, median"
            result.check(target, text, name, quantity, at_most=limit, claim="ours")
        for words in KNOWING:
            case = f"{name}, {words}"
            result.add(target, f"{case}: attitude RMSE", case, "attitude_rmse_rad", unit="rad")
            result.add(target, f"{case}: {kind.compared}", case, kind.compared)
            text = f"{case}: upright to the end, every robot"
            result.check(
                target, text, case, "held", at_least=1.0, statistic="share",
                claim="ours",
            )  # fmt: skip
        for quantity in ("attitude_rmse_rad", kind.compared):
            text = f"{name}: {quantity} with identified parameters at most 10 % above that with true ones"
            over = (f"{name}, true", quantity, "ekf")
            result.check(target, text, f"{name}, identified", quantity, at_most=1.1, over=over, claim="ours")
        text = f"{name}: the shipped parameters cost 10 % or more, so that this run can tell"
        over = (f"{name}, true", kind.compared, "ekf")
        result.check(
            target, text, f"{name}, as shipped", kind.compared, at_least=1.1, over=over, claim="ours"
        )
    with plt.rc_context(style.RC):
        figure, panels = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
        for axes, (name, kind) in zip(panels, KINDS.items(), strict=True):
            for i, words in enumerate(KNOWING):
                values = data.values(f"{name}, {words}", kind.compared)
                axes.plot(
                    np.full(values.size, i) + np.linspace(-0.2, 0.2, values.size),
                    values,
                    ".",
                    color=style.colour(i),
                )
                axes.plot([i - 0.25, i + 0.25], [np.median(values)] * 2, color=style.TRUTH, lw=1.6)
            axes.set(
                xticks=range(len(KNOWING)), title=name, ylabel=kind.compared.replace("_", " "), ylim=(0, None)
            )
            axes.set_xticklabels(KNOWING)
        style.save(figure, out_dir / "identify_to_run")
    result.pictures.append("identify_to_run")
    return result
