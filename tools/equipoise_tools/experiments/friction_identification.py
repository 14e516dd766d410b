"""5.3: friction and flywheel from the rig's log (Fig. 5.3); motors from the dynamometer's (section 4.5.1)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from .. import style
from ..log import read_log
from ..style import plt
from .framework import Result
from .runs import equipoise, equipoise_json

COVERS = ("Fig. 5.3",)
RATIO = 1.25
PUT_IN = {  # name: value put in, printed in [T], unit
    "coulomb_friction_N_m": (0.05265, 0.05265, "N m"),
    "viscous_friction_N_m_s": (0.001056, 0.001056, "N m s"),
    "flywheel_inertia_kg_m2": (1.5e-3, None, "kg m2"),
}
K1, K2 = 0.176, 0.011  # [T] Table 5.2


def run(out_dir: Path) -> Result:
    result = Result(
        title="Friction identification (Fig. 5.3)",
        command="equipoise friction-rig --log rig.lcm && equipoise identify friction rig.lcm "
        f"--radius-ratio {RATIO}",
        method="The held robot sweeps its ball on a flywheel, 20 s, 0.1 to 2 Hz, amplitude 3; regression "
        "(5.37) with the powers of the radius ratio that follow from the gearing. Then the same with "
        "stiction and with friction that differs by direction.",
        differs="our rig's flywheel and noise are chosen, since [T] prints neither; the friction put in "
        "is [T]'s.",
    )
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "rig.lcm"
        found = identify(log)
        bench = read_log(log)["EQUIPOISE_BENCH"]
        sticky = identify(log, ("--static-ratio", 1.8))
        slow = ("--static-ratio", 2.0, "--amplitude-u", 0.8)
        stribeck = identify(log, slow, ("--stribeck",))
        sided = identify(log, ("--negative-scale", 1.3), ("--separate-directions",))
    estimates = found["estimates"]
    for name, (true, printed, unit) in PUT_IN.items():
        value, width = estimates[name]["value"], estimates[name]["half_width_95"]
        result.add("Fig. 5.3", name, value, printed, unit)
        result.add("Fig. 5.3", f"{name}, half width of the 95 % interval", width, None, unit)
        inside = abs(value - true) <= 1.5 * width
        result.check("Fig. 5.3", f"{name}: what was put in lies within 1.5 intervals", inside)
    result.add("Fig. 5.3", "R²", found["r_squared"], 0.93)
    for name in ("coulomb_friction_N_m", "flywheel_inertia_kg_m2"):
        off = abs(estimates[name]["value"] / PUT_IN[name][0] - 1)
        result.check("Fig. 5.3", f"{name} within 2 % of what was put in", off < 0.02)
    result.check("Fig. 5.3", "R² at least 0.9", found["r_squared"] > 0.9)
    despite = sticky["estimates"]["coulomb_friction_N_m"]["value"]
    result.add(
        "Fig. 5.3", "Coulomb friction despite stiction", despite, PUT_IN["coulomb_friction_N_m"][0], "N m"
    )
    off = abs(despite / PUT_IN["coulomb_friction_N_m"][0] - 1)
    result.check("Fig. 5.3", "stiction leaves the Coulomb friction found within 2 %", off < 0.02)
    excess = stribeck["estimates"]["stribeck_excess_N_m"]
    result.add("Fig. 5.3", "Stribeck excess in a slow sweep, 0.053 put in", excess["value"], None, "N m")
    result.check("Fig. 5.3", "stiction is found where it is", excess["determined"])
    sides = [sided["estimates"][f"coulomb_friction_{side}_N_m"]["value"] for side in ("positive", "negative")]
    result.add("Fig. 5.3", "friction backwards over forwards, 1.3 put in", sides[1] / sides[0])
    result.check("Fig. 5.3", "directions are told apart", abs(sides[1] / sides[0] - 1.3) < 0.05)
    draw(out_dir / "friction_identification.png", bench, estimates)
    result.pictures.append("friction_identification.png")
    return result


def identify(log: Path, rig: tuple = (), options: tuple = ()) -> dict:
    equipoise("friction-rig", "--log", log, *rig)
    return equipoise_json("identify", "friction", log, "--radius-ratio", RATIO, *options)


def draw(path: Path, bench: np.ndarray, estimates: dict) -> None:
    """Torque that neither motors nor flywheel explain, over the ball's rate, and the model."""
    t_s = (bench["utime"] - bench["utime"][0]) * 1e-6
    half = 5
    rate = np.gradient(bench["angle_rad"], t_s)
    rate = RATIO * np.convolve(rate, np.ones(2 * half) / (2 * half), mode="same")
    acceleration = np.convolve(np.gradient(rate, t_s), np.ones(2 * half) / (2 * half), mode="same")
    inertia = estimates["flywheel_inertia_kg_m2"]["value"] / RATIO**2
    friction = K1 * bench["u"] - K2 * rate - inertia * acceleration
    at = np.linspace(rate.min(), rate.max(), 401)
    model = (
        estimates["coulomb_friction_N_m"]["value"] * np.sign(at)
        + estimates["viscous_friction_N_m_s"]["value"] * at
    )
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        axes.plot(rate, friction, ".", ms=2, color=style.TRUTH, label="log")
        axes.plot(at, model, color=style.ESTIMATE, label="identified")
        axes.set(xlabel="ball rate, rad/s", ylabel="friction torque, N m")
        axes.legend()
        figure.savefig(path)
        plt.close(figure)
