"""Chapter 3: attitude of the MIP spinning at 0, 5 and 10 rad/s, five estimators against motion capture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import names, style
from ..style import plt
from .framework import Result
from .runs import simulate

COVERS = ("Table 3.3", "Fig. 3.4")
YAW_RATES = (0, 5, 10)
# Our estimator: [T]'s name, its printed RMSE at each yaw rate.
PRINTED = {
    "attitude": ("DMP", (0.0148, 0.0115, 0.0129)),
    "planar_kf": ("Planar EKF", (0.0133, 0.0256, 0.1028)),
    "ekf": ("High Yaw Rate EKF", (0.0133, 0.0107, 0.0249)),
    "complementary": ("Complementary Filter", (0.0228, 0.0424, 0.1605)),
    "complementary_kf": ("Complementary KF", (0.0199, 0.0432, 0.1636)),
}
DEGRADING = ("planar_kf", "complementary", "complementary_kf")
MOCAP_HZ = 120.0
MOCAP_SIGMA_RAD = 0.002  # a fraction of a millimetre on a body of 0.1 m
SETTLED_S = 5.0
DURATION_S = 60.0


def lean(records) -> np.ndarray:
    return np.asarray(records["theta_rad"])[:, 0]


def motion_capture(log, random) -> tuple[np.ndarray, np.ndarray]:
    """(seconds, lean) as cameras see it: the plant's truth at their rate, with noise."""
    seconds = log.seconds(names.TRUTH)
    at = np.arange(SETTLED_S, seconds[-1], 1 / MOCAP_HZ)
    theta = np.interp(at, seconds, lean(log[names.TRUTH]))
    return at, theta + random.normal(0.0, MOCAP_SIGMA_RAD, at.size)


def measure(yaw_rate: float, seed: int = 1):
    """(summary, mocap seconds, mocap lean, {estimator: lean then}); controlled as in [T], by the DMP."""
    summary, log = simulate(
        "config/edumip.toml",
        yaw_rad_s=yaw_rate,
        duration_s=DURATION_S,
        seed=seed,
        estimator="attitude",
        compare=True,
    )
    at, truth = motion_capture(log, np.random.default_rng(seed))
    estimates = {}
    for channel in log:
        estimator = names.estimator_of(channel)
        if estimator in PRINTED:
            estimates[estimator] = np.interp(at, log.seconds(channel), lean(log[channel]))
    return summary, at, truth, estimates


def run(out_dir: Path) -> Result:
    result = Result(
        title="MIP attitude at high yaw rates (chapter 3)",
        command="./tools/experiments table_3_3",
        method=f"{DURATION_S:.0f} s of the eduMIP in the nominal world at 0, 5 and 10 rad/s; all estimators "
        f"on the same samples, against the plant's truth at {MOCAP_HZ:.0f} Hz with "
        f"{1e3 * MOCAP_SIGMA_RAD:.0f} mrad of noise. The attitude packets control, as in [T].",
        differs="our plant's disturbances are modelled; our EKF knows where the IMU is and weighs friction.",
    )
    rmse = {name: [] for name in PRINTED}
    runs = []
    for index, yaw_rate in enumerate(YAW_RATES):
        summary, at, truth, estimates = measure(yaw_rate)
        runs.append((at, truth, estimates))
        result.check("Table 3.3", f"balances {DURATION_S:.0f} s at {yaw_rate} rad/s", not summary["fell"])
        for name, (label, printed) in PRINTED.items():
            rmse[name].append(float(np.sqrt(np.mean((estimates[name] - truth) ** 2))))
            result.add("Table 3.3", f"{label}, {yaw_rate} rad/s", rmse[name][index], printed[index], "rad")
        ours = rmse["ekf"][index]
        result.check("Table 3.3", f"our EKF is within 0.010 rad at {yaw_rate} rad/s", ours <= 0.010)
    for name in DEGRADING:
        label = PRINTED[name][0]
        result.check("Table 3.3", f"{label} degrades to 0.08 rad or more at 10 rad/s", rmse[name][2] >= 0.08)
    print_table(rmse)
    draw(runs, out_dir / "table_3_3.png")
    result.check("Fig. 3.4", "drawn for every yaw rate", len(runs) == len(YAW_RATES))
    result.pictures.append("table_3_3.png")
    return result


def print_table(rmse: dict[str, list[float]]) -> None:
    heads = "".join(f"{f'{w} rad/s':>10}{'[T]':>9}" for w in YAW_RATES)
    print(f"{'RMSE, rad':<22}{heads}")
    for name, (label, printed) in PRINTED.items():
        cells = "".join(f"{a:>10.4f}{b:>9.4f}" for a, b in zip(rmse[name], printed, strict=True))
        print(f"{label:<22}{cells}")


def draw(runs, path: Path) -> None:
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(3, 1, figsize=(9, 8), layout="constrained")
        for ax, yaw_rate, (at, truth, estimates) in zip(axes, YAW_RATES, runs, strict=True):
            shown = at < SETTLED_S + 10.0
            for name, (label, _) in PRINTED.items():
                ax.plot(at[shown], estimates[name][shown], lw=0.9, label=label)
            ax.plot(at[shown], truth[shown], color="black", lw=1.1, label="motion capture")
            ax.set(ylabel="θ, rad", title=f"{yaw_rate} rad/s")
        axes[0].legend(ncols=3, fontsize=8)
        axes[-1].set(xlabel="time, s")
        figure.savefig(path)
        plt.close(figure)
