"""4.6: the eduMIP balances behind drive/brake, drive/coast and compensated drive/coast bridges (Fig. 4.6)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import metrics, names, style
from ..style import plt
from .data import Data
from .framework import Result
from .runs import BUILT, MIP, Case

COVERS = ("Fig. 4.6", "Fig. 4.6, 1 kHz", "Fig. 4.6, uncompensated at 10 and 20 kHz")
PWM_HZ = (500, 1000, 5000, 10000, 20000)
WORLDS = (BUILT, "nominal")
MODES = {  # whether the firmware inverts the bridge's model
    "coast": {"motor.invert_bridge": "false"},
    "coast, compensated": {},
}
# A bridge that is not inverted hardly moves a wheel at small duties: it would be taken for dead encoders.
NO_PROBE = {"safety.encoder_probe_drive": 0}
DURATION_S = 30.0
BRAKE = "brake"


def lean_variance(log: Log, summary: dict) -> dict:
    """Of the true lean while the robot holds its position, mrad^2; none when it falls."""
    if summary["ended"] != "finished":
        return {("", "lean_variance_mrad2"): np.nan}
    settled = log.seconds(names.TRUTH) >= metrics.SETTLE_S
    return {("", "lean_variance_mrad2"): 1e6 * float(np.var(log[names.TRUTH]["theta_rad"][settled, 0]))}


def case_name(world: str, mode: str, pwm_hz: int) -> str:
    return f"{world}, {mode}, {pwm_hz} Hz"


def cases() -> list[Case]:
    found = []
    for world in WORLDS:
        options = {"duration_s": DURATION_S, "fidelity": world}
        found.append(Case(f"{world}, {BRAKE}", MIP, NO_PROBE, options, measure=lean_variance))
        for mode, sets in MODES.items():
            for pwm_hz in PWM_HZ:
                bridge = {f"world.{world}.bridge": "drive_coast", "motor.pwm_hz": float(pwm_hz)}
                name = case_name(world, mode, pwm_hz)
                found.append(Case(name, MIP, bridge | sets | NO_PROBE, options, measure=lean_variance))
    return found


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Attitude variance by bridge mode and PWM frequency (Fig. 4.6)",
        command="equipoise sim --config config/edumip.toml --fidelity built2025 --set "
        "world.built2025.bridge=drive_coast "
        "--set motor.pwm_hz=20000 [--set motor.invert_bridge=false]",
        method=f"The eduMIP holds its position for {DURATION_S:.0f} s; one controller, designed for "
        "drive/brake. "
        "Compensated: the firmware inverts the drive/coast model; not compensated: it sends the "
        "drive/brake duty. "
        "Drive/brake does not depend on the PWM frequency here and is run once.",
        differs="[T] plots no numbers; its drivers' dead times and diodes are not ours, and our motor's "
        "inductance is "
        "an estimate. Its exception at 1 kHz, a limit cycle of its robot, does not appear here. Where "
        "friction and "
        "play are large (built2025 world) the compensated bridge is calmer than drive/brake.",
        data=data,
    )
    for world in WORLDS:
        braking = f"{world}, {BRAKE}"
        result.add("Fig. 4.6", "tilt variance, brake", braking, "lean_variance_mrad2", unit="mrad²")
        over = (braking, "lean_variance_mrad2", "ekf")
        for mode in MODES:
            for pwm_hz in PWM_HZ:
                case = case_name(world, mode, pwm_hz)
                what = f"{mode}, {pwm_hz} Hz"
                result.add("Fig. 4.6", f"tilt variance, {what}", case, "lean_variance_mrad2", unit="mrad²")
                if mode == "coast":
                    result.add("Fig. 4.6", f"share of runs upright to the end, {what}", case, "held")
        for pwm_hz in PWM_HZ:
            case = case_name(world, "coast, compensated", pwm_hz)
            if pwm_hz == 1000:
                text = f"{world}: compensated coasting at 1000 Hz is worse than braking by 15 % or more"
                result.check("Fig. 4.6, 1 kHz", text, case, "lean_variance_mrad2", at_least=1.15, over=over)
                continue
            text = f"{world}: compensated coasting at {pwm_hz} Hz is no worse than braking by more than 15 %"
            result.check("Fig. 4.6", text, case, "lean_variance_mrad2", at_most=1.15, over=over)
            text = f"{world}: compensated coasting at {pwm_hz} Hz equals braking within 15 %"
            result.check("Fig. 4.6", text, case, "lean_variance_mrad2", between=(0.85, 1.15), over=over)
        for pwm_hz in PWM_HZ[:3]:
            text = f"{world}: uncompensated coasting at {pwm_hz} Hz is worse than braking by 15 % or more"
            case = case_name(world, "coast", pwm_hz)
            result.check("Fig. 4.6", text, case, "lean_variance_mrad2", at_least=1.15, over=over)
        for pwm_hz in PWM_HZ[3:]:
            text = f"{world}: uncompensated coasting at {pwm_hz} Hz stays upright ([T]'s robot did)"
            case = case_name(world, "coast", pwm_hz)
            result.check("Fig. 4.6, uncompensated at 10 and 20 kHz", text, case, "held", at_least=1.0,
                         statistic="share")  # fmt: skip
    draw(out_dir, data)
    result.pictures.append("bridge_modes")
    return result


def draw(out_dir: Path, data: Data) -> None:
    with plt.rc_context(style.RC):
        figure, panels = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
        for axes, world in zip(panels, WORLDS, strict=True):
            low, middle, high = np.percentile(
                data.values(f"{world}, {BRAKE}", "lean_variance_mrad2"), (5, 50, 95)
            )
            axes.axhspan(low, high, color=style.TRUTH, alpha=0.15, lw=0)
            axes.axhline(middle, color=style.TRUTH, label="brake")
            for i, mode in enumerate(MODES):
                shown = []
                for pwm_hz in PWM_HZ:
                    values = data.values(case_name(world, mode, pwm_hz), "lean_variance_mrad2")
                    if values.size:
                        shown.append((pwm_hz, *np.percentile(values, (5, 50, 95))))
                    else:
                        axes.plot(pwm_hz, 4e4, "x", color=style.colour(i), ms=8, mew=2)
                at, low, middle, high = np.array(shown).T
                axes.fill_between(at, low, high, color=style.colour(i), alpha=0.2, lw=0)
                axes.plot(at, middle, "o-", color=style.colour(i), label=mode)
            axes.set(
                xscale="log", yscale="log", xlabel="PWM frequency, Hz", title=f"{world} world (x: all fall)"
            )
        panels[0].set_ylabel("variance of the tilt, mrad²")
        style.legend_above(figure, panels[0])
        style.save(figure, out_dir / "bridge_modes")
