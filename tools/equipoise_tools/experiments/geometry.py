"""Chapter 2: wheel tilt, normal force, torque shares and wobble over the wheels' latitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .framework import Result
from .runs import equipoise_json

COVERS = ("Table 2.1", "(2.1), Fig. 2.5", "(2.2)")
TABLE_2_1 = {45: 35.237, 60: 48.186, 70: 52.082, 80: 54.145}
BALL_RADIUS_M = 0.032
ROW_SPACING_M = np.linspace(0.0, 0.012, 25)


def run(out_dir: Path) -> Result:
    result = Result(
        title="Omniwheel placement (chapter 2)",
        command="equipoise geometry --alpha-deg 60 --json -",
        method="Latitude of the wheels against the tilt that makes their axes orthogonal, in closed form "
        "cos β = 1/(√3 sin α); load per wheel (2.2); share of a wheel's torque that turns and that moves "
        "the ball; "
        "angle between the torque axes of the two rows (2.1).",
        differs="[T] found β by iteration and stopped up to 0.03° early; the closed form is exact.",
    )
    latitudes = np.arange(36.0, 85.0)
    over_latitude = [equipoise_json("geometry", "--alpha-deg", a) for a in latitudes]
    for alpha, printed in TABLE_2_1.items():
        at = equipoise_json("geometry", "--alpha-deg", alpha)
        result.add("Table 2.1", f"β at α = {alpha}°", at["beta_deg"], printed, "deg")
        result.check("Table 2.1", f"orthonormal to 1e-12 at {alpha}°", at["orthonormality_error"] < 1e-12)
        result.check("Table 2.1", f"within 0.04° of print at {alpha}°", abs(at["beta_deg"] - printed) < 0.04)
    load = {a: equipoise_json("geometry", "--alpha-deg", a)["normal_force_over_weight"] for a in (45, 70)}
    result.add("(2.2)", "load at 70° over load at 45°", load[70] / load[45], 2.0)
    result.check("(2.2)", "70° doubles the wheels' load against 45°", 1.9 < load[70] / load[45] < 2.2)
    wobble_deg = np.degrees(np.arcsin(ROW_SPACING_M / (2 * BALL_RADIUS_M)))
    result.add(
        "(2.1), Fig. 2.5",
        "γ at a row spacing of 6 mm",
        float(np.interp(0.006, ROW_SPACING_M, wobble_deg)),
        None,
        "deg",
    )

    with plt.rc_context(style.RC):
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
        left.plot(
            latitudes, [g["beta_deg"] for g in over_latitude], color=style.ESTIMATE, label="closed form"
        )
        left.plot(TABLE_2_1.keys(), TABLE_2_1.values(), "o", color=style.REFERENCE, label="[T] Table 2.1")
        left.set(xlabel="latitude α, deg", ylabel="tilt β, deg", title="Orthogonal wheels")
        left.legend()
        middle.plot(latitudes, [g["normal_force_over_weight"] for g in over_latitude], label="load / weight")
        middle.plot(
            latitudes, [g["translation_torque_share"] for g in over_latitude], label="translation share"
        )
        middle.plot(latitudes, [abs(g["yaw_torque_share"]) for g in over_latitude], label="yaw share")
        middle.set(xlabel="latitude α, deg", title="Load and torque shares", ylim=(0, 2))
        middle.legend()
        right.plot(1e3 * ROW_SPACING_M, wobble_deg, color=style.ESTIMATE)
        right.set(xlabel="distance of the rows, mm", ylabel="γ, deg", title="Wobble (2.1)")
        figure.savefig(out_dir / "geometry.png")
        plt.close(figure)
    result.pictures.append("geometry.png")
    return result
