"""5.3: friction and flywheel from the rig's log (Fig. 5.3)."""

from __future__ import annotations

import tempfile
from pathlib import Path

from .framework import Result
from .runs import equipoise, equipoise_json

COVERS = ("Fig. 5.3",)
MU_C, MU_V, FLYWHEEL, RATIO = 0.05265, 0.001056, 1.5e-3, 1.25


def run(out_dir: Path) -> Result:
    result = Result(
        title="Friction identification (Fig. 5.3)",
        command="equipoise friction-rig --log rig.lcm && equipoise identify friction rig.lcm "
        "--radius-ratio 1.25",
        method="The held robot sweeps its ball on a flywheel, 20 s, 0.1 to 2 Hz, amplitude 3; regression "
        "(5.37) with "
        "the powers of the radius ratio that follow from the gearing.",
        differs="our rig's flywheel and noise are chosen, since [T] prints neither; the friction put in "
        "is [T]'s.",
    )
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "rig.lcm"
        equipoise("friction-rig", "--log", log)
        found = equipoise_json("identify", "friction", log, "--radius-ratio", RATIO)
        equipoise("friction-rig", "--log", log, "--static-ratio", 1.8)
        sticky = equipoise_json("identify", "friction", log, "--radius-ratio", RATIO)
    estimates = found["estimates"]
    for name, true, unit in (
        ("coulomb_friction_N_m", MU_C, "N m"),
        ("viscous_friction_N_m_s", MU_V, "N m s"),
        ("flywheel_inertia_kg_m2", FLYWHEEL, "kg m2"),
    ):
        printed = None if name.startswith("flywheel") else true
        result.add("Fig. 5.3", name, estimates[name]["value"], printed, unit)
    result.add("Fig. 5.3", "R²", found["r_squared"], 0.93)
    off = abs(estimates["coulomb_friction_N_m"]["value"] / MU_C - 1)
    result.check("Fig. 5.3", "Coulomb friction within 2 % of what was put in", off < 0.02)
    result.check("Fig. 5.3", "R² at least 0.9", found["r_squared"] > 0.9)
    result.check("Fig. 5.3", "stiction lowers the fit", sticky["r_squared"] < found["r_squared"])
    return result
