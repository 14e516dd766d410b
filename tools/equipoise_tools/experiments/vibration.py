"""6.4.4: vibration of the ball over drive speed, by the rollers' rows taking turns (Fig. 6.24)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import metrics, mocap, names, style
from ..style import plt
from .data import Data, Ran
from .framework import Result
from .runs import BUILT, NO_GATES, Case, Lab, equipoise_json

COVERS = ("Fig. 6.24", "Fig. 6.24, band")
DRIVE_MPS = (0.05, 0.10, 0.15, 0.20)
WHEEL_RADIUS_M, ROLLERS_OF_A_ROW = 0.0125, 6  # [T] 2.3.1: twelve rollers in two planes
ALPHA_DEG, AZIMUTH_DEG = 60.0, -140.0
ROLLER_TILT_RAD = 0.094  # (2.1): rows 6 mm apart, our guess
FITTED = "rows 6 mm apart, six rollers each, are put in"
WORLD = BUILT
DURATION_S = 60.0
LOWEST_RAD_S, HIGHEST_RAD_S = 12.0, 200.0  # above the balance loop's own motion


def case_name(drive: float) -> str:
    return f"{100 * drive:.0f} cm/s"


def passing_rate(drive_mps: float) -> float:
    """Rollers of a row that pass the fastest wheel's contact, rad/s, when the robot drives along x."""
    T_ob = equipoise_json("geometry", "--alpha-deg", ALPHA_DEG, "--azimuth-deg", AZIMUTH_DEG)["T_ob"]
    return ROLLERS_OF_A_ROW * drive_mps / WHEEL_RADIUS_M * max(map(abs, T_ob[1]))  # the ball rolls about y


def spectrum(log: Log) -> tuple[np.ndarray, np.ndarray]:
    t_s = log.seconds(names.TRUTH)
    settled = t_s >= metrics.SETTLE_S
    rate = metrics.rolling_rates(log[names.TRUTH], 2)[settled]
    omega, first = mocap.spectrum(t_s[settled], rate[:, 0])
    _, second = mocap.spectrum(t_s[settled], rate[:, 1])
    return omega, np.hypot(first, second)


def strongest_line(log: Log, summary: dict) -> dict:
    """Where the ball's true rate vibrates most above the balance loop, and how far above the spectrum's "
    "median."""
    if summary["ended"] != "finished":
        return {}
    omega, amplitude = spectrum(log)
    inside = (omega > LOWEST_RAD_S) & (omega < HIGHEST_RAD_S)
    at = np.flatnonzero(inside)[np.argmax(amplitude[inside])]
    return {
        ("", "strongest_line_rad_s"): float(omega[at]),
        ("", "line_over_median"): float(amplitude[at] / np.median(amplitude[inside])),
    }


def trace(log: Log) -> dict:
    omega, amplitude = spectrum(log)
    at = np.arange(0, 200, 0.5)
    widest = [amplitude[(omega >= a) & (omega < a + 0.5)].max(initial=1e-6) for a in at]
    return {"spectrum": (np.arange(at.size) / 20, np.array(widest))}


def cases() -> list[Case]:
    tilt = f"world.{WORLD}.disturbance."
    return [
        Case(
            case_name(drive),
            sets={
                f"{tilt}roller_tilt_rad": ROLLER_TILT_RAD,
                f"{tilt}rollers_per_turn": float(ROLLERS_OF_A_ROW),
                **NO_GATES,
            },
            options={"drive_mps": drive, "duration_s": DURATION_S, "fidelity": WORLD},
            fitted=FITTED,
            measure=strongest_line,
            trace=trace,
        )
        for drive in DRIVE_MPS
    ]


def measure(lab: Lab) -> Data:
    data = lab.run(cases())
    for drive in DRIVE_MPS:
        data.add(case_name(drive), "passing_rate_rad_s", passing_rate(drive), Ran(world="geometry"))
    return data


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Vibration over drive speed (Fig. 6.24)",
        command=f"equipoise sim --config config/mbbr.toml --fidelity {WORLD} --drive-mps 0.2 "
        f"--set world.{WORLD}.disturbance.roller_tilt_rad={ROLLER_TILT_RAD} "
        f"--set world.{WORLD}.disturbance.rollers_per_turn=6",
        method=f"The robot drives without spin at four speeds, {DURATION_S:.0f} s; the two rows of its "
        "double-row wheels "
        "take turns, each turning the wheel's torque axis (2.1). [T] 2.3.1 has twelve rollers in two "
        "planes: six of "
        "a row pass in a turn. The strongest line of the ball's true rate between "
        f"{LOWEST_RAD_S:.0f} and {HIGHEST_RAD_S:.0f} rad/s, wherever it is, against the rate at which a "
        "row's rollers "
        "pass the fastest wheel.",
        differs="[T] prints neither the rows' distance nor which run its 17 to 25 rad/s is of. With six "
        "rollers a row "
        "the fastest wheel's rate is 19.5 rad/s at 5 cm/s and 78 rad/s at 20 cm/s: the band fits slow "
        "driving only.",
        data=data,
    )
    ran = "ekf"
    for drive in DRIVE_MPS:
        case = case_name(drive)
        result.add("Fig. 6.24", f"strongest line, {case}", case, "strongest_line_rad_s", ran, unit="rad/s")
        result.add("Fig. 6.24", f"passing rate, {case}", case, "passing_rate_rad_s", "-", unit="rad/s")
        result.add("Fig. 6.24", f"line over the spectrum's median, {case}", case, "line_over_median", ran)
        text = f"{case}: the strongest line is at the passing rate of a row's rollers, within 10 %"
        over = (case, "passing_rate_rad_s", "-")
        result.check("Fig. 6.24", text, case, "strongest_line_rad_s", ran, between=(0.9, 1.1), over=over)
    text = "the line's frequency rises with the speed: 15 cm/s over 5 cm/s is 3, within 15 %"
    over = (case_name(0.05), "strongest_line_rad_s", ran)
    result.check(
        "Fig. 6.24", text, case_name(0.15), "strongest_line_rad_s", ran, between=(2.55, 3.45), over=over
    )
    for drive in (0.05, 0.20):
        case = case_name(drive)
        text = f"{case}: the strongest line lies in 17 to 25 rad/s"
        result.check("Fig. 6.24, band", text, case, "strongest_line_rad_s", ran, between=(17.0, 25.0))
    with plt.rc_context(style.RC):
        figure, rows = plt.subplots(4, 1, figsize=(8, 7), layout="constrained", sharex=True, sharey=True)
        for i, (axes, drive) in enumerate(zip(rows, DRIVE_MPS, strict=True)):
            case = case_name(drive)
            values = data.trace(case, "spectrum")
            axes.semilogy(
                0.5 * np.arange(values.size), values, color=style.colour(i), lw=0.9, label="true ball rate"
            )
            axes.axvline(
                data.statistic(case, "passing_rate_rad_s", "-"),
                color=style.REFERENCE,
                ls="--",
                label="passing rate of a row's rollers",
            )
            axes.axvspan(17, 25, color="#999999", alpha=0.2, lw=0, label="[T]: 17 to 25 rad/s")
            axes.set(ylabel="rad/s", title=case)
        axes.set(xlabel="frequency, rad/s", xlim=(0, 200))
        style.legend_above(figure, rows[0])
        style.save(figure, out_dir / "vibration")
    result.pictures.append("vibration")
    return result
