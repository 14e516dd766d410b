"""6.4.3: errors of the printed EKF in the calibrated world (Table 6.1), spectrum of the ball (Fig. 6.13)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import metrics, mocap, names, style
from ..calibrate_disturbance import DURATION_S, TABLE_6_1, run_row
from ..style import plt
from .framework import Result

COVERS = ("Table 6.1", "Fig. 6.13")
WITHIN = 0.30
INCLUDE = {"include": '["fragments/table_6_1.toml"]'}


def label(row: tuple) -> str:
    return f"{row[0]:g} Hz, {100 * row[1]:.0f} cm/s"


def run(out_dir: Path) -> Result:
    result = Result(
        title="Estimation errors of the printed EKF (Table 6.1, Fig. 6.13)",
        command="equipoise sim --config config/mbbr.toml --set 'include=[\"fragments/table_6_1.toml\"]' "
        "--estimator ekf13_published --controller scheduled --yaw-hz 0.5",
        method="Disturbances of the nominal world as calibrated once for all seven rows by "
        "`python -m equipoise_tools.calibrate_disturbance` (config/fragments/table_6_1.toml); the printed "
        "EKF with the noise of (6.28) estimates, and its estimates control through the scheduled gains.",
        differs="one set of disturbances must explain fourteen errors of a robot whose own controller (6.29) "
        "falls in our plant, so another one moves ours; the printed model's 410 for 502 in (5.28) biases the "
        "attitude while driving, which [T]'s robot does not show. Longer runs err more in speed "
        "while spinning (1.6 to 1.9 times print at 30 s). Rows that miss are marked above.",
    )
    speeds, logs = {}, {}
    for row in TABLE_6_1:
        summary, logs[row] = run_row(INCLUDE, row, DURATION_S)
        ours = summary["estimators"]["ekf13_published"]
        result.check("Table 6.1", f"{label(row)}: stays upright", not summary["fell"])
        for what, key, printed, factor, unit in (
            ("attitude RMSE", "attitude_rmse_rad", row[2], 1, "rad"),
            ("ball speed RMSE", "ball_speed_rmse_m_s", row[3], 100, "cm/s"),
        ):
            ratio = ours[key] / printed
            result.add("Table 6.1", f"{what}, {label(row)}", factor * ours[key], factor * printed, unit)
            near = abs(ratio - 1) <= WITHIN
            result.check("Table 6.1", f"{label(row)}: {what} within 30 % ({ratio:.2f} of print)", near)
        speeds[row[:2]] = ours["ball_speed_rmse_m_s"]
    rising = speeds[0.0, 0.0] < speeds[0.5, 0.0] < speeds[1.0, 0.0]
    result.check("Table 6.1", "ball speed errors grow with the yaw rate, 0 - 0.5 - 1 Hz", rising)
    draw(out_dir / "table_6_1.png", logs[TABLE_6_1[0]], result)
    result.pictures.append("table_6_1.png")
    return result


def draw(path: Path, log, result: Result) -> None:
    channels = (
        (names.STATE, "printed EKF", style.ESTIMATE),
        (names.TRUTH, "truth", style.TRUTH),
    )
    noise = {}
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
        for channel, name, colour in channels:
            t_s = log.seconds(channel)
            settled = t_s >= metrics.SETTLE_S
            rate = metrics.rolling_rates(log[channel], 2)[settled, 1]
            omega, amplitude = mocap.spectrum(t_s[settled], rate)
            axes.semilogy(omega, amplitude, color=colour, label=name)
            band = (omega > 17) & (omega < 25)
            quiet = (omega > 40) & (omega < 60)
            noise[name] = float(np.median(amplitude[quiet]))
            contrast = float(amplitude[band].max() / noise[name])
            what = f"largest line in 17-25 rad/s over the floor at 40-60 rad/s, {name}"
            result.add("Fig. 6.13", what, contrast)
            if name == "truth":
                result.check("Fig. 6.13", "the ball's own speed has a line in 17-25 rad/s", contrast > 3)
        axes.set(xlim=(0, 60), xlabel="rad/s", ylabel="ball rate, rad/s", title=label(TABLE_6_1[0]))
        axes.legend()
        figure.savefig(path)
        plt.close(figure)
    noisier = noise["printed EKF"] > noise["truth"]
    result.check("Fig. 6.13", "the estimate is noisier than the ball (40-60 rad/s)", noisier)
