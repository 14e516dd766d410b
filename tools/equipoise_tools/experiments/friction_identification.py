"""5.3: friction and flywheel from the rig's log (Fig. 5.3), and what motors of unequal strength do to it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from equipoise_robot.log import read_log

from .. import style
from ..style import plt
from .data import Data, Ran
from .framework import Result
from .runs import Lab, equipoise, equipoise_json

COVERS = ("Fig. 5.3", "Fig. 5.3, 11.5 %")
RATIO = 1.25
PUT_IN = {  # name: value put in, printed in [T], unit
    "coulomb_friction_N_m": (0.05265, 0.05265, "N m"),
    "viscous_friction_N_m_s": (0.001056, 0.001056, "N m s"),
    "flywheel_inertia_kg_m2": (1.5e-3, None, "kg m2"),
}
K1, K2 = 0.176, 0.011  # [T] Table 5.2
RAN = Ran(world="friction rig", fitted="friction, flywheel and noise of the rig are put in")
PRINTED_RATIO = 1.115  # [T] 5.3: the flywheel by y over by x
RIGS = {  # case: options of the rig, of the identification
    "as identified": ((), ()),
    "stiction": (("--static-ratio", 1.8), ()),
    "slow, stiction": (("--static-ratio", 2.0, "--amplitude-u", 0.8), ("--stribeck",)),
    "friction by direction": (("--negative-scale", 1.3), ("--separate-directions",)),
}


def identify(log: Path, seed: int, rig: tuple = (), options: tuple = ()) -> dict:
    equipoise("friction-rig", "--log", log, "--seed", seed, *rig)
    return equipoise_json("identify", "friction", log, "--radius-ratio", RATIO, *options)


def smallest_spread(flywheel_ratio: float) -> float:
    """Of the motors' torques, strongest less weakest over nominal, that makes one axis as much stronger.

    Torque about a body axis is the sum over the motors of (share of the axis)^2 times the motor's scale.
    """
    T_ob = np.array(equipoise_json("geometry", "--alpha-deg", 60, "--azimuth-deg", -140)["T_ob"])
    lever = np.abs(T_ob[0] ** 2 - T_ob[1] ** 2).sum()  # every motor at its worst: +-spread/2
    return 2 * (flywheel_ratio - 1) / lever


def measure(lab: Lab) -> Data:
    data = Data()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "rig.lcm"
        for case, (rig, options) in RIGS.items():
            for seed in range(1, lab.seeds + 1):
                found = identify(log, seed, rig, options)
                data.add(case, "r_squared", found["r_squared"], RAN, seed, 20.0)
                for name, estimate in found["estimates"].items():
                    if estimate["determined"]:
                        data.add(case, name, estimate["value"], RAN, seed, 20.0)
                    if name in PUT_IN:
                        off = 100 * abs(estimate["value"] / PUT_IN[name][0] - 1)
                        data.add(case, f"{name}_error_percent", off, RAN, seed, 20.0)
                if case == "friction by direction":
                    sides = [
                        found["estimates"][f"coulomb_friction_{s}_N_m"]["value"]
                        for s in ("positive", "negative")
                    ]
                    data.add(case, "backwards_over_forwards", sides[1] / sides[0], RAN, seed, 20.0)
        identify(log, 1)
        bench = read_log(log)["EQUIPOISE_BENCH"]
    t_s = (bench["utime"] - bench["utime"][0]) * 1e-6
    every = max(1, t_s.size // 800)
    data.traces["as identified", "t_s"] = np.round(t_s, 4)[::every]
    rate, friction = explained(bench, t_s, data.statistic("as identified", "flywheel_inertia_kg_m2"))
    data.traces["as identified", "rate"] = np.round(rate, 3)[::every]
    data.traces["as identified", "friction"] = np.round(friction, 5)[::every]
    spread = smallest_spread(PRINTED_RATIO)
    data.add("unequal motors", "smallest_spread", spread, Ran(world="(6.5), first order in the spread"))
    return data


def explained(bench: np.ndarray, t_s: np.ndarray, flywheel_kg_m2: float) -> tuple[np.ndarray, np.ndarray]:
    """(ball's rate, torque that neither motors nor flywheel explain)."""
    window = np.ones(10) / 10
    rate = RATIO * np.convolve(np.gradient(bench["angle_rad"], t_s), window, mode="same")
    acceleration = np.convolve(np.gradient(rate, t_s), window, mode="same")
    return rate, K1 * bench["u"] - K2 * rate - flywheel_kg_m2 / RATIO**2 * acceleration


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Friction identification (Fig. 5.3)",
        command="equipoise friction-rig --log rig.lcm && equipoise identify friction rig.lcm "
        f"--radius-ratio {RATIO}",
        method="The held robot sweeps its ball on a flywheel, 20 s, 0.1 to 2 Hz, amplitude 3; regression "
        "(5.37) with "
        "the powers of the radius ratio that follow from the gearing. Then the same with stiction and with "
        "friction that differs by direction. 11.5 %: how unequal the motors must be to explain it.",
        differs="our rig's flywheel and noise are chosen, since [T] prints neither; the friction put in "
        "is [T]'s, so "
        "that it comes back shows the method, not the number.",
        data=data,
    )
    for name, (true, printed, unit) in PUT_IN.items():
        result.add("Fig. 5.3", name, "as identified", name, published=printed, unit=unit)
        text = f"{name}: {true:g} put in comes back within {5 if 'viscous' in name else 2} %, median"
        limit = 5.0 if "viscous" in name else 2.0
        result.check("Fig. 5.3", text, "as identified", f"{name}_error_percent", at_most=limit, claim="ours")
    result.add("Fig. 5.3", "R²", "as identified", "r_squared", published=0.93)
    text = "Coulomb and viscous friction explain the sweep, R² 0.9 or more"
    result.check("Fig. 5.3", text, "as identified", "r_squared", at_least=0.9)
    text = "Coulomb friction within 2 % despite stiction"
    quantity = "coulomb_friction_N_m_error_percent"
    result.check("Fig. 5.3", text, "stiction", quantity, at_most=2.0, claim="ours")
    quantity = "stribeck_excess_N_m"
    result.add(
        "Fig. 5.3", "Stribeck excess in a slow sweep, 0.053 put in", "slow, stiction", quantity, unit="N m"
    )
    text = "stiction is found in a slow sweep, 0.053 N m within 20 %"
    result.check("Fig. 5.3", text, "slow, stiction", quantity, between=(0.042, 0.063), claim="ours")
    text = "friction backwards 1.3 times forwards is found within 0.05"
    quantity = "backwards_over_forwards"
    result.check("Fig. 5.3", text, "friction by direction", quantity, between=(1.25, 1.35), claim="ours")
    target = "Fig. 5.3, 11.5 %"
    what = "spread of the motors that makes a flywheel look 11.5 % heavier by y than by x"
    result.add(target, what, "unequal motors", "smallest_spread")
    text = "it takes motors that differ by 15 % or more, not by 11.5 %"
    result.check(target, text, "unequal motors", "smallest_spread", at_least=0.15, claim="ours")
    draw(data, out_dir)
    result.pictures.append("friction_identification")
    return result


def draw(data: Data, out_dir: Path) -> None:
    """Torque that neither motors nor flywheel explain, over the ball's rate, and the model."""
    rate, friction = (data.trace("as identified", series) for series in ("rate", "friction"))
    at = np.linspace(rate.min(), rate.max(), 401)
    coulomb, viscous = (data.statistic("as identified", name) for name in list(PUT_IN)[:2])
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        axes.plot(rate, friction, ".", ms=2.5, color=style.TRUTH, label="log")
        axes.plot(at, coulomb * np.sign(at) + viscous * at, color=style.ESTIMATE, label="identified")
        axes.plot(
            at, 0.05265 * np.sign(at) + 0.001056 * at, "--", color=style.REFERENCE, label="[T] 5.3"
        )  # fmt: skip
        axes.set(xlabel="ball rate, rad/s", ylabel="friction torque, N m")
        style.legend_above(figure, axes)
        style.save(figure, out_dir / "friction_identification")
