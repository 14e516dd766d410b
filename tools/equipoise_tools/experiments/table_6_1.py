"""Table 6.1 and Fig. 6.13: errors of the printed EKF in the calibrated world; spectrum of the ball's "
"speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import metrics, mocap, names, style
from ..calibrate_disturbance import TABLE_6_1
from ..style import plt
from .framework import Result
from .runs import fragment, simulate

COVERS = ("Table 6.1", "Fig. 6.13")
WITHIN = 1.30


def label(row: tuple) -> str:
    return f"{row[0]:g} Hz, {100 * row[1]:.0f} cm/s"


def run(out_dir: Path) -> Result:
    result = Result(
        title="Estimation errors of the printed EKF (Table 6.1, Fig. 6.13)",
        command="equipoise sim --config config/mbbr.toml --set 'include=[\"fragments/table_6_1.toml\"]' "
        "--estimator ekf13_published --controller scheduled --compare --yaw-hz 0.5",
        method="Disturbances of the full world as calibrated once for all seven rows by "
        "`python -m equipoise_tools.calibrate_disturbance`; the printed EKF with (6.28) estimates and its "
        "estimates control through the scheduled gains.",
        differs="one set of disturbances, searched for minutes, must explain fourteen errors of a robot "
        "whose own "
        "controller (6.29) falls in our plant; the printed model's 410 for 502 in (5.28) makes the attitude "
        "wrong while driving steadily, which [T]'s robot does not show.",
    )
    sets = fragment("table_6_1")
    speeds, logs = [], {}
    for row in TABLE_6_1:
        options = {"yaw_hz": row[0], "drive_mps": row[1], "duration_s": 25}
        summary, log = simulate(
            sets=sets, estimator="ekf13_published", controller="scheduled", compare=True, **options
        )
        logs[label(row)] = log
        ours = summary["estimators"]["ekf13_published"]
        result.check("Table 6.1", f"{label(row)}: stays upright", not summary["fell"])
        for what, key, printed, factor, unit in (
            ("attitude RMSE", "attitude_rmse_rad", row[2], 1, "rad"),
            ("ball speed RMSE", "ball_speed_rmse_m_s", row[3], 100, "cm/s"),
        ):
            ratio = ours[key] / printed
            result.add("Table 6.1", f"{what}, {label(row)}", factor * ours[key], factor * printed, unit)
            near = 1 / WITHIN <= ratio <= WITHIN
            result.check("Table 6.1", f"{label(row)}: {what} within 30 % ({ratio:.2f} of print)", near)
        speeds.append(ours["ball_speed_rmse_m_s"])
    rising = speeds[1] < speeds[2] < speeds[3]
    result.check("Table 6.1", "ball speed errors grow with the yaw rate, 0 - 0.5 - 1 Hz", rising)
    draw(out_dir, logs[label(TABLE_6_1[0])], result)
    return result


def draw(out_dir: Path, log, result: Result) -> None:
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
        for channel, name, colour in (
            (names.STATE, "EKF", style.ESTIMATE),
            (names.TRUTH, "truth", style.TRUTH),
        ):
            records = log[channel]
            t_s = log.seconds(channel)
            settled = t_s >= metrics.SETTLE_S
            rate = metrics.rolling_rates(records, 2)[settled, 1]
            omega, amplitude = mocap.spectrum(t_s[settled], rate)
            axes.semilogy(omega, amplitude, color=colour, label=name)
            band = (omega > 17) & (omega < 25)
            quiet = (omega > 40) & (omega < 60)
            contrast = float(amplitude[band].max() / np.median(amplitude[quiet]))
            result.add(
                "Fig. 6.13", f"largest line in 17-25 rad/s over the floor at 40-60 rad/s, {name}", contrast
            )
            if name == "truth":
                result.check("Fig. 6.13", "the ball's own speed has a line in 17-25 rad/s", contrast > 3)
        axes.set(xlim=(0, 60), xlabel="rad/s", ylabel="ball rate, rad/s", title="0 Hz, 20 cm/s")
        axes.legend()
        figure.savefig(out_dir / "table_6_1.png")
        plt.close(figure)
    result.pictures.append("table_6_1.png")
