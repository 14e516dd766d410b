"""2.3.3: torque over speed of the MBBR's motor with several gears, and the region it works in (Fig. 2.10)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .data import Data
from .framework import Result
from .runs import Lab, equipoise_json

COVERS = ("Fig. 2.10", "2.3.3")
# [T] sections 2.3.3 and 6.2.3; the motor is identified at the wheel, behind 12:1.
BATTERY_V = 7.4
RESISTANCE_OHM = 3.385
TORQUE_CONSTANT_12 = 0.0742
REGION_N_M, REGION_RPM = 0.06, 600.0
RATIOS = (6, 9, 12, 20, 30, 50)
# [T] Table 5.2.
MASS_KG, COM_M, G = 0.550, 0.100, 9.8
BALL_RADIUS_M, WHEEL_RADIUS_M = 0.032, 0.0125


def identified(ratio: float) -> tuple[float, float]:
    """Stall torque and no-load speed at the battery's voltage, N m and rpm, behind another gear."""
    k = TORQUE_CONSTANT_12 * ratio / 12
    return k * BATTERY_V / RESISTANCE_OHM, BATTERY_V / k * 30 / np.pi


def margins(stall_N_m: float, no_load_rpm: float) -> tuple[float, float]:
    """(torque left at the region's speed, speed left at its torque), N m and rpm."""
    return stall_N_m * (1 - REGION_RPM / no_load_rpm), no_load_rpm * (1 - REGION_N_M / stall_N_m)


def wheel_torque_N_m(lean_rad: float, T_ob: np.ndarray) -> float:
    """Largest torque of one wheel, over lean directions, that balances gravity at this lean."""
    about_ball = MASS_KG * G * COM_M * np.sin(lean_rad) * WHEEL_RADIUS_M / BALL_RADIUS_M
    return float(about_ball * np.hypot(T_ob[0], T_ob[1]).max())


def measure(lab: Lab) -> Data:
    data = Data()
    for ratio in RATIOS:
        torque, speed = margins(*identified(ratio))
        data.add(f"{ratio}:1", "torque_at_600_rpm_N_m", torque)
        data.add(f"{ratio}:1", "speed_at_0.06_N_m_rpm", speed)
    best = max(np.linspace(4, 40, 361), key=lambda ratio: margins(*identified(ratio))[0])
    data.add("2.3.3", "gear_with_most_torque_at_600_rpm", best)
    data.add("2.3.3", "speed_at_600_rpm_m_s", 600 * np.pi / 30 * WHEEL_RADIUS_M)
    data.add("2.3.3", "four_ball_turns_a_second_m_s", 4 * 2 * np.pi * BALL_RADIUS_M)
    T_ob = np.array(equipoise_json("geometry", "--alpha-deg", 60, "--azimuth-deg", -140)["T_ob"])
    data.add("2.3.3", "torque_at_30_degrees_N_m", wheel_torque_N_m(np.radians(30), T_ob))
    return data


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Motor and gearbox selection (Fig. 2.10, section 2.3.3)",
        command="tools/experiments motor_selection",
        method="Torque-speed lines of the identified motor at 7.4 V with the gear varied; the shaded "
        "corner is "
        "[T]'s region of operation, 0.06 N m and 600 rpm. A gear serves when the corner lies below its "
        "line. The "
        "text's numbers from Table 5.2: speed = wheel rate x wheel radius; torque of the most loaded wheel, "
        "(r_w/r) m g l sin 30° times the largest level part of a wheel's axis.",
        differs="[T] draws the maker's motor curve, which it does not print; ours is the motor it "
        "identified, and "
        "12:1 reaches the corner with nothing to spare.",
        data=data,
    )
    result.add(
        "Fig. 2.10", "torque of 12:1 at 600 rpm", "12:1", "torque_at_600_rpm_N_m", published=0.06, unit="N m"
    )
    result.add(
        "Fig. 2.10", "speed of 12:1 at 0.06 N m", "12:1", "speed_at_0.06_N_m_rpm", published=600.0, unit="rpm"
    )
    result.check("Fig. 2.10", "12:1 covers the region", "12:1", "torque_at_600_rpm_N_m", at_least=REGION_N_M)
    quantity = "gear_with_most_torque_at_600_rpm"
    result.add("Fig. 2.10", "gear with the most torque at 600 rpm", "2.3.3", quantity, published=12.0)
    text = "50:1 gives less than the region's torque at 600 rpm"
    result.check("Fig. 2.10", text, "50:1", "torque_at_600_rpm_N_m", at_most=REGION_N_M, claim="ours")
    quantity = "speed_at_600_rpm_m_s"
    result.add(
        "2.3.3", "robot's speed at 600 rpm of the wheels", "2.3.3", quantity, published=1.5, unit="m/s"
    )
    text = "600 rpm of the wheel drive at about 1.5 m/s (within 20 %)"
    result.check("2.3.3", text, "2.3.3", quantity, between=(1.2, 1.8), derived=True)
    text = "600 rpm of the wheel are about four turns of the ball a second (within 20 %)"
    over = ("2.3.3", "four_ball_turns_a_second_m_s", "-")
    result.check("2.3.3", text, "2.3.3", quantity, between=(0.8, 1.2), over=over, derived=True)
    quantity = "torque_at_30_degrees_N_m"
    result.add(
        "2.3.3",
        "torque of the most loaded wheel at 30° of lean",
        "2.3.3",
        quantity,
        published=0.06,
        unit="N m",
    )
    text = "0.06 N m is a generous estimate for 30° of lean"
    result.check("2.3.3", text, "2.3.3", quantity, at_most=0.06, derived=True)
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for i, ratio in enumerate(RATIOS):
            stall, no_load_rpm = identified(ratio)
            line = [0, no_load_rpm], [stall, 0]
            axes.plot(*line, color=style.colour(i), lw=2 if ratio == 12 else 1, label=f"{ratio}:1")
        axes.add_patch(plt.Rectangle((0, 0), REGION_RPM, REGION_N_M, color=style.REFERENCE, alpha=0.3, lw=0))
        axes.set(xlabel="speed at the wheel, rpm", ylabel="torque, N m", xlim=(0, 2500), ylim=(0, 0.6))
        axes.set_title("Motor at 7.4 V; shaded: region of operation")
        style.legend_above(figure, axes, 6)
        style.save(figure, out_dir / "motor_selection")
    result.pictures.append("motor_selection")
    return result
