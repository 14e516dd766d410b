"""6.4.4: EKF, KF and DMP while spinning in place (Fig. 6.14), gains of Table 6.2; spectrum over speed "
"(Fig. 6.24)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import metrics, mocap, names, style
from ..style import plt
from .framework import Result
from .runs import simulate

COVERS = ("Fig. 6.14", "Table 6.2", "Fig. 6.24")
YAW_HZ = (-1.5, -1.0, -0.75, -0.5, 0.0, 0.5, 0.75, 1.0, 1.5)
DRIVE_MPS = (0.05, 0.10, 0.15, 0.20)
# [T] Table 6.2: c1 .. c6 over yaw rate.
TABLE_6_2 = {
    0.0: (10, 0.4, 0.5, 0.075, 0.4, 1.2),
    0.5: (12, 0.4, 0.5, 0.10, 0.4, 1.2),
    0.75: (14, 0.4, 0.6, 0.10, 0.4, 1.2),
    1.0: (13, 0.4, 0.6, 0.075, 0.4, 1.2),
    1.5: (12, 0.6, 0.5, 0.060, 0.4, 1.2),
}


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
        "sensors. "
        "DMP: the attitude source beside the linear KF. The gains of Table 6.2 are run with [T]'s "
        "controller.",
        differs="Fig. 6.14's bars are not printed as numbers; our linear KF turns with the frame (the "
        "printed one "
        "loses its transport term) and takes its attitude from the DMP, so it does not show a KF attitude.",
    )
    attitude, speed = {}, {}
    for hz in YAW_HZ:
        summary, _ = simulate(yaw_hz=hz, compare=True, duration_s=20)
        for name, errors in summary["estimators"].items():
            attitude.setdefault(name, []).append(errors["attitude_rmse_rad"])
            speed.setdefault(name, []).append(100 * errors["ball_speed_rmse_m_s"])
            result.add(
                "Fig. 6.14", f"attitude RMSE, {name}, {hz:g} Hz", errors["attitude_rmse_rad"], None, "rad"
            )
            result.add("Fig. 6.14", f"ball speed RMSE, {name}, {hz:g} Hz", speed[name][-1], None, "cm/s")
        result.check("Fig. 6.14", f"upright at {hz:g} Hz", not summary["fell"])
    gap = max(abs(a - b) for a, b in zip(speed["ekf"], speed["kf_attitude"], strict=True))
    result.add("Fig. 6.14", "largest difference of KF and EKF in ball speed", gap, None, "cm/s")
    result.check("Fig. 6.14", "KF and EKF equal in ball speed (within 1 cm/s at every yaw rate)", gap < 1.0)
    better = np.mean(attitude["kf_attitude"]) < np.mean(attitude["ekf13_published"])
    result.check("Fig. 6.14", "the DMP's attitude is better than the printed EKF's", better)
    for hz in TABLE_6_2:
        summary, _ = simulate(
            sets={"controller.thesis.gains": gains()},
            controller="thesis",
            yaw_hz=hz,
            compare=True,
            duration_s=15,
        )
        held = summary["fell_at_s"] if summary["fell"] else summary["duration_s"]
        result.add("Table 6.2", f"time upright at {hz:g} Hz, of 15 s", held, None, "s")
        if hz <= 1.0:
            result.check("Table 6.2", f"its gains hold {hz:g} Hz in place", not summary["fell"])
    spectra(out_dir, result)
    draw(out_dir, attitude, speed)
    result.pictures += ["estimation_accuracy.png", "estimation_accuracy_fft.png"]
    return result


def spectra(out_dir: Path, result: Result) -> None:
    """Where the ball's true speed vibrates, over drive speed."""
    peaks = []
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for i, drive in enumerate(DRIVE_MPS):
            _, log = simulate(
                drive_mps=drive, duration_s=30, sets={"world.full.disturbance.roller_tilt_rad": 0.09}
            )
            t_s = log.seconds(names.TRUTH)
            settled = t_s >= metrics.SETTLE_S
            rate = metrics.rolling_rates(log[names.TRUTH], 2)[settled]
            omega, first = mocap.spectrum(t_s[settled], rate[:, 0])
            _, second = mocap.spectrum(t_s[settled], rate[:, 1])
            amplitude = np.hypot(first, second)
            axes.semilogy(omega, amplitude, color=style.colour(i), label=f"{100 * drive:.0f} cm/s")
            seen = (omega > 10) & (omega < 250)
            peaks.append(float(omega[seen][np.argmax(amplitude[seen])]))
            result.add(
                "Fig. 6.24",
                f"strongest line above 10 rad/s at {100 * drive:.0f} cm/s",
                peaks[-1],
                None,
                "rad/s",
            )
        axes.set(xlim=(0, 250), xlabel="rad/s", ylabel="true ball rate, rad/s", title="Drive without spin")
        axes.legend()
        figure.savefig(out_dir / "estimation_accuracy_fft.png")
        plt.close(figure)
    result.check(
        "Fig. 6.24",
        "the vibration's frequency rises with the drive speed",
        peaks == sorted(peaks) and peaks[0] < peaks[-1],
    )
    result.check("Fig. 6.24", "it lies in 17-25 rad/s at some speed", any(17 <= p <= 25 for p in peaks))


def draw(out_dir: Path, attitude: dict, speed: dict) -> None:
    with plt.rc_context(style.RC):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
        for i, name in enumerate(n for n in attitude if n != "truth"):
            left.semilogy(YAW_HZ, attitude[name], "o-", color=style.colour(i), label=name)
            right.semilogy(YAW_HZ, speed[name], "o-", color=style.colour(i))
        left.set(xlabel="yaw rate, Hz", ylabel="attitude RMSE, rad")
        right.set(xlabel="yaw rate, Hz", ylabel="ball speed RMSE, cm/s")
        left.legend()
        figure.savefig(out_dir / "estimation_accuracy.png")
        plt.close(figure)
