"""6.4.4: EKF, KF and DMP while spinning in place (Fig. 6.14, Table 6.2); spectra over speed (Fig. 6.24)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import metrics, mocap, names, style
from ..style import plt
from .framework import Result
from .runs import equipoise_json, simulate, summarise

COVERS = ("Fig. 6.14", "Table 6.2", "Fig. 6.24")
YAW_HZ = (-1.5, -1.0, -0.75, -0.5, 0.0, 0.5, 0.75, 1.0, 1.5)
DRIVE_MPS = (0.05, 0.10, 0.15, 0.20)
COMPARED = ("ekf", "ekf13", "ekf13_published", "kf_attitude")
# [T] Table 6.2: c1 .. c6 over yaw rate.
TABLE_6_2 = {
    0.0: (10, 0.4, 0.5, 0.075, 0.4, 1.2),
    0.5: (12, 0.4, 0.5, 0.10, 0.4, 1.2),
    0.75: (14, 0.4, 0.6, 0.10, 0.4, 1.2),
    1.0: (13, 0.4, 0.6, 0.075, 0.4, 1.2),
    1.5: (12, 0.6, 0.5, 0.060, 0.4, 1.2),
}
WHEEL_RADIUS_M, ROLLERS = 0.0125, 12
ALPHA_DEG, AZIMUTH_DEG = 60.0, -140.0
ROLLER_TILT_RAD = 0.05


def gains() -> str:
    rows = [
        f"{{yaw_hz = {hz}, " + ", ".join(f"c{i + 1} = {c}" for i, c in enumerate(row)) + "}"
        for hz, row in TABLE_6_2.items()
    ]
    return "[" + ", ".join(rows) + "]"


def run(out_dir: Path) -> Result:
    result = Result(
        title="Estimators while spinning in place (Fig. 6.14, 6.24, Table 6.2)",
        command="equipoise sim --config config/mbbr.toml --yaw-hz 1 --compare --json -",
        method="Spin in place at nine yaw rates; the corrected EKF controls, all estimators see the same "
        "sensors. DMP: the attitude source beside the linear KF. The gains of Table 6.2 are run with [T]'s "
        "controller. Spectra: the rollers' rows switch, the robot drives without spin.",
        differs="Fig. 6.14's bars are not printed as numbers; our linear KF turns with the frame (the "
        "printed one loses its transport term) and takes its attitude from the DMP, so it does not show a KF "
        "attitude. At 20 cm/s rollers pass a wheel at up to 150 rad/s: [T]'s 17-25 rad/s is not this rate.",
    )
    attitude, speed = spin_in_place(result)
    for hz in TABLE_6_2:
        summary = summarise(
            sets={"controller.thesis.gains": gains()}, controller="thesis", yaw_hz=hz, duration_s=15
        )
        held = summary["fell_at_s"] if summary["fell"] else summary["duration_s"]
        result.add("Table 6.2", f"time upright at {hz:g} Hz, of 15 s", held, None, "s")
        result.check("Table 6.2", f"its gains hold {hz:g} Hz in place", not summary["fell"])
    spectra(out_dir / "estimation_accuracy_fft.png", result)
    draw(out_dir / "estimation_accuracy.png", attitude, speed)
    result.pictures += ["estimation_accuracy.png", "estimation_accuracy_fft.png"]
    return result


def spin_in_place(result: Result) -> tuple[dict, dict]:
    attitude = {name: [] for name in COMPARED}
    speed = {name: [] for name in COMPARED}
    for hz in YAW_HZ:
        summary = summarise(yaw_hz=hz, compare=True, duration_s=20)
        result.check("Fig. 6.14", f"upright at {hz:g} Hz", not summary["fell"])
        for name in COMPARED:
            errors = summary["estimators"][name]
            attitude[name].append(errors["attitude_rmse_rad"])
            speed[name].append(100 * errors["ball_speed_rmse_m_s"])
            result.add("Fig. 6.14", f"attitude RMSE, {name}, {hz:g} Hz", attitude[name][-1], None, "rad")
            result.add("Fig. 6.14", f"ball speed RMSE, {name}, {hz:g} Hz", speed[name][-1], None, "cm/s")
    gap = max(abs(a - b) for a, b in zip(speed["ekf"], speed["kf_attitude"], strict=True))
    result.add("Fig. 6.14", "largest difference of KF and EKF in ball speed", gap, None, "cm/s")
    result.check("Fig. 6.14", "KF and EKF equal in ball speed (within 1 cm/s at every yaw rate)", gap < 1.0)
    better = np.mean(attitude["kf_attitude"]) < np.mean(attitude["ekf13_published"])
    result.check("Fig. 6.14", "the DMP's attitude is better than the printed EKF's", better)
    return attitude, speed


def passing_rates(drive_mps: float) -> np.ndarray:
    """Rollers of a row per second that pass each wheel's contact, rad/s, when the robot drives along x."""
    T_ob = equipoise_json("geometry", "--alpha-deg", ALPHA_DEG, "--azimuth-deg", AZIMUTH_DEG)["T_ob"]
    return ROLLERS * drive_mps / WHEEL_RADIUS_M * np.abs(T_ob[1])  # the ball rolls about y


def line(omega: np.ndarray, amplitude: np.ndarray, expected: float) -> tuple[float, float]:
    """(rad/s, height over the floor) of the strongest line within 10 % of where it should be."""
    near = np.abs(omega / expected - 1) < 0.10
    around = (np.abs(omega / expected - 1) < 0.5) & ~near
    at = np.flatnonzero(near)[np.argmax(amplitude[near])]
    return float(omega[at]), float(amplitude[at] / np.median(amplitude[around]))


def spectra(path: Path, result: Result) -> None:
    """Where the ball's true speed vibrates, over drive speed."""
    found = []
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for i, drive in enumerate(DRIVE_MPS):
            _, log = simulate(
                drive_mps=drive,
                duration_s=30,
                sets={"world.full.disturbance.roller_tilt_rad": ROLLER_TILT_RAD},
            )
            t_s = log.seconds(names.TRUTH)
            settled = t_s >= metrics.SETTLE_S
            rate = metrics.rolling_rates(log[names.TRUTH], 2)[settled]
            omega, first = mocap.spectrum(t_s[settled], rate[:, 0])
            _, second = mocap.spectrum(t_s[settled], rate[:, 1])
            amplitude = np.hypot(first, second)
            axes.semilogy(omega, amplitude, color=style.colour(i), label=f"{100 * drive:.0f} cm/s")
            lines = [line(omega, amplitude, rate) for rate in passing_rates(drive) if rate > 5.0]
            at, height = max(lines, key=lambda each: each[1])
            found.append((drive, at, height))
            what = f"line at a wheel's roller passing rate, {100 * drive:.0f} cm/s"
            result.add("Fig. 6.24", what, at, None, "rad/s")
            result.add("Fig. 6.24", f"{what}, over the floor", height)
        axes.set(xlim=(0, 250), xlabel="rad/s", ylabel="true ball rate, rad/s", title="Drive without spin")
        axes.legend()
        figure.savefig(path)
        plt.close(figure)
    stands_out = all(height > 3 for _, _, height in found)
    result.check("Fig. 6.24", "the ball vibrates at a roller passing rate at every drive speed", stands_out)
    rising = all(a[1] < b[1] for a, b in zip(found, found[1:], strict=False))
    result.check("Fig. 6.24", "that line's frequency rises with the drive speed", rising)


def draw(path: Path, attitude: dict, speed: dict) -> None:
    with plt.rc_context(style.RC):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
        for i, name in enumerate(attitude):
            left.semilogy(YAW_HZ, attitude[name], "o-", color=style.colour(i), label=name)
            right.semilogy(YAW_HZ, speed[name], "o-", color=style.colour(i))
        left.set(xlabel="yaw rate, Hz", ylabel="attitude RMSE, rad")
        right.set(xlabel="yaw rate, Hz", ylabel="ball speed RMSE, cm/s")
        left.legend()
        figure.savefig(path)
        plt.close(figure)
