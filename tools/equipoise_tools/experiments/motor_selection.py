"""Fig. 2.10: torque over speed of the MBBR's motor with several gears, and the region it works in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .framework import Result

COVERS = ("Fig. 2.10",)
# [T] sections 2.3.3 and 6.2.3; the motor is identified at the wheel, behind 12:1.
BATTERY_V = 7.4
RESISTANCE_OHM = 3.385
TORQUE_CONSTANT_12 = 0.0742
REGION_N_M, REGION_RPM = 0.06, 600.0
RATIOS = (6, 9, 12, 20, 30, 50)


def margins(ratio: float) -> tuple[float, float]:
    """(torque left at the region's speed, speed left at its torque), N m and rpm."""
    k = TORQUE_CONSTANT_12 * ratio / 12
    stall = k * BATTERY_V / RESISTANCE_OHM
    no_load_rpm = BATTERY_V / k * 30 / np.pi
    return stall * (1 - REGION_RPM / no_load_rpm), no_load_rpm * (1 - REGION_N_M / stall)


def run(out_dir: Path) -> Result:
    result = Result(
        title="Motor and gearbox selection (Fig. 2.10)",
        command="tools/experiments motor_selection",
        method="Torque-speed lines of the identified motor at 7.4 V with the gear varied; the shaded "
        "corner is the "
        "region of operation, 0.06 N m and 600 rpm. A gear serves when the corner lies below its line.",
        differs="[T] draws the maker's motor curve, which it does not print; ours is the motor it "
        "identified.",
    )
    serving = [ratio for ratio in RATIOS if margins(ratio)[0] >= REGION_N_M]
    torque, speed = margins(12)
    result.add("Fig. 2.10", "torque of 12:1 at 600 rpm", torque, None, "N m")
    result.add("Fig. 2.10", "speed of 12:1 at 0.06 N m", speed, None, "rpm")
    result.check("Fig. 2.10", "12:1 covers the region", 12 in serving)
    result.check("Fig. 2.10", "50:1 is too slow for it", 50 not in serving)
    best = max(np.linspace(4, 40, 361), key=lambda ratio: margins(ratio)[0])
    result.add("Fig. 2.10", "gear with the most torque at 600 rpm", best, 12.0)
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        for i, ratio in enumerate(RATIOS):
            k = TORQUE_CONSTANT_12 * ratio / 12
            line = [0, BATTERY_V / k * 30 / np.pi], [k * BATTERY_V / RESISTANCE_OHM, 0]
            axes.plot(*line, color=style.colour(i), lw=2 if ratio == 12 else 1, label=f"{ratio}:1")
        axes.add_patch(plt.Rectangle((0, 0), REGION_RPM, REGION_N_M, color=style.REFERENCE, alpha=0.2, lw=0))
        axes.set(xlabel="speed at the wheel, rpm", ylabel="torque, N m", xlim=(0, 2500), ylim=(0, 0.6))
        axes.set_title("Motor at 7.4 V; shaded: region of operation")
        axes.legend(title="gear")
        figure.savefig(out_dir / "motor_selection.png")
        plt.close(figure)
    result.pictures.append("motor_selection.png")
    return result
