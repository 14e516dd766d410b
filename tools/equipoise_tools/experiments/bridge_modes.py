"""4.6: the eduMIP balances behind drive/brake, drive/coast and compensated drive/coast bridges (Fig. 4.6)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import metrics, names, style
from ..style import plt
from .framework import Result
from .runs import simulate

COVERS = ("Fig. 4.6",)
PWM_HZ = (500, 1000, 5000, 10000, 20000)
MODES = {  # the robot's bridge, and whether the firmware inverts it
    "brake": {"world.nominal.bridge": "drive_brake"},
    "coast": {"world.nominal.bridge": "drive_coast", "motor.invert_bridge": "false"},
    "coast, compensated": {"world.nominal.bridge": "drive_coast"},
}
SEEDS = (1, 2, 3)
DURATION_S = 30
FALLEN = float("inf")


def variance(sets: dict[str, str], pwm_hz: float, seed: int) -> float:
    """Of the true lean while the robot holds its position, rad^2; infinite when it falls."""
    summary, log = simulate(
        "config/edumip.toml",
        sets={"motor.pwm_hz": float(pwm_hz), **sets},
        duration_s=DURATION_S,
        seed=seed,
    )
    if summary["fell"]:
        return FALLEN
    settled = log.seconds(names.TRUTH) >= metrics.SETTLE_S
    return float(np.var(log[names.TRUTH]["theta_rad"][settled, 0]))


def run(out_dir: Path) -> Result:
    result = Result(
        title="Attitude variance by bridge mode and PWM frequency (Fig. 4.6)",
        command="equipoise sim --config config/edumip.toml --set world.nominal.bridge=drive_coast "
        "--set motor.pwm_hz=20000 [--set motor.invert_bridge=false]",
        method=f"The eduMIP holds its position for {DURATION_S} s in the nominal world, {len(SEEDS)} seeds; "
        "one controller, designed for drive/brake. Compensated: the firmware inverts the drive/coast model; "
        "not compensated: it sends the drive/brake duty.",
        differs="[T] plots no numbers, and its drivers' dead times and diodes are not ours.",
    )
    means: dict[str, list[float]] = {mode: [] for mode in MODES}
    for mode, sets in MODES.items():
        for pwm_hz in PWM_HZ:
            means[mode].append(float(np.mean([variance(sets, pwm_hz, seed) for seed in SEEDS])))
            shown = means[mode][-1]
            what = f"lean variance, {mode}, {pwm_hz} Hz"
            result.add("Fig. 4.6", what, 1e6 * shown if np.isfinite(shown) else None, None, "mrad²")
    judge(result, means)
    draw(out_dir / "bridge_modes.png", means)
    result.pictures.append("bridge_modes.png")
    return result


def judge(result: Result, means: dict[str, list[float]]) -> None:
    for i, pwm_hz in enumerate(PWM_HZ):
        ratio = means["coast, compensated"][i] / means["brake"][i]
        result.add("Fig. 4.6", f"compensated over brake, {pwm_hz} Hz", ratio)
        near = abs(ratio - 1) <= 0.15
        text = f"compensated coasting within 15 % of the brake's variance at {pwm_hz} Hz"
        result.check("Fig. 4.6", text, near)
    coast = means["coast"]
    worse = all(c > 1.15 * b for c, b in zip(coast[2:], means["brake"][2:], strict=True))
    result.check("Fig. 4.6", "uncompensated coasting is worse from 5 kHz on", worse)
    text = "uncompensated coasting is worst at the highest PWM frequencies"
    result.check("Fig. 4.6", text, max(coast[3:]) == max(coast))


def draw(path: Path, means: dict[str, list[float]]) -> None:
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for i, (mode, values) in enumerate(means.items()):
            axes.loglog(PWM_HZ, [1e6 * v for v in values], "o-", color=style.colour(i), label=mode)
        axes.set(xlabel="PWM frequency, Hz", ylabel="variance of the lean, mrad²")
        axes.legend()
        figure.savefig(path)
        plt.close(figure)
