"""Chapter 2: wheel tilt, normal force, torque shares and wobble over the wheels' latitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .data import Data
from .framework import Result
from .runs import Lab, equipoise_json

COVERS = ("Table 2.1", "(2.1), Fig. 2.5", "(2.2)", "2.3.2", "(6.5)")
TABLE_2_1 = {45: 35.237, 60: 48.186, 70: 52.082, 80: 54.145}
T_OB = ((-0.7344, 0.0583, 0.6761), (0.3567, -0.8144, 0.4577), (0.5744, 0.5744, 0.5774))  # (6.5)
AXES = "xyz"
BALL_RADIUS_M = 0.032
ROW_SPACING_M = 0.006
LATITUDES = tuple(float(a) for a in range(36, 85))


def alpha(latitude: float) -> str:
    return f"latitude {latitude:g}"


def shares_without_tilt(latitude: float) -> tuple[float, float]:
    """(translation, yaw): horizontal and vertical part of a wheel's axis when beta is 0."""
    return np.cos(np.radians(latitude)), np.sin(np.radians(latitude))


def measure(lab: Lab) -> Data:
    data = Data()
    for latitude in LATITUDES:
        found = equipoise_json("geometry", "--alpha-deg", latitude)
        case = alpha(latitude)
        for quantity in (
            "beta_deg",
            "orthonormality_error",
            "normal_force_over_weight",
            "translation_torque_share",
        ):
            data.add(case, quantity, found[quantity])
        data.add(case, "yaw_torque_share", abs(found["yaw_torque_share"]))
        translation, yaw = shares_without_tilt(latitude)
        data.add(case, "translation_share_without_tilt", translation)
        data.add(case, "yaw_share_without_tilt", yaw)
        if int(latitude) in TABLE_2_1:
            error = abs(found["beta_deg"] - TABLE_2_1[int(latitude)])
            data.add(case, "printed_tilt_error_deg", error)
            data.add(
                case,
                "printed_axes_not_orthogonal_deg",
                not_orthogonal_deg(latitude, TABLE_2_1[int(latitude)]),
            )
    T_ob = equipoise_json("geometry", "--alpha-deg", 60, "--azimuth-deg", -140)["T_ob"]
    for row, axis in enumerate(AXES):
        case = f"(6.5) row {axis}"
        data.add(
            case, "largest_difference", max(abs(a - b) for a, b in zip(T_ob[row], T_OB[row], strict=True))
        )
        data.add(case, "printed_length", np.linalg.norm(T_OB[row]))
    data.add("rows 6 mm apart", "wobble_deg", np.degrees(np.arcsin(ROW_SPACING_M / (2 * BALL_RADIUS_M))))
    return data


def not_orthogonal_deg(latitude: float, tilt: float) -> float:
    """How far the axes of two wheels are from a right angle, (2.3)-(2.5) with this tilt."""
    a, b = np.radians(latitude), np.radians(tilt)
    w = np.array([np.cos(a) * np.cos(b), np.sin(b), -np.sin(a) * np.cos(b)])
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = np.array([c * w[0] - s * w[1], s * w[0] + c * w[1], w[2]])
    return float(abs(np.degrees(np.arcsin(w @ turned))))


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Omniwheel placement (chapter 2)",
        command="equipoise geometry --alpha-deg 60 --json -",
        method="Latitude of the wheels against the tilt that makes their axes orthogonal, in closed form "
        "cos β = 1/(√3 sin α); load per wheel (2.2); the part of a wheel's axis that lies level (moves the "
        "robot) and upright (turns it), with that tilt and without; angle between the torque axes of the two "
        "rows (2.1).",
        differs="[T] found β by iteration and stopped up to 0.04° early; the closed form is exact. (6.5) "
        "prints "
        "0.5744 for 0.57735 in its third row, twice.",
        data=data,
    )
    for latitude, printed in TABLE_2_1.items():
        case = alpha(latitude)
        result.add("Table 2.1", f"β at α = {latitude}°", case, "beta_deg", published=printed, unit="deg")
        text = f"α = {latitude}°: the printed tilt makes the axes orthogonal within 0.1°"
        result.check("Table 2.1", text, case, "printed_axes_not_orthogonal_deg", at_most=0.1, derived=True)
        text = f"closed form orthonormal to 1e-12 at {latitude}°"
        result.check("Table 2.1", text, case, "orthonormality_error", at_most=1e-12, claim="ours")
    for axis in AXES:
        text = f"(6.5) row {axis} to its printed digits"
        result.check("(6.5)", text, f"(6.5) row {axis}", "largest_difference", at_most=1e-4, derived=True)
        result.add(
            "(6.5)", f"length of printed row {axis}", f"(6.5) row {axis}", "printed_length", published=1.0
        )
    result.add("(2.2)", "load per wheel over weight at 45°", alpha(45), "normal_force_over_weight")
    result.add("(2.2)", "load per wheel over weight at 70°", alpha(70), "normal_force_over_weight")
    over = (alpha(45), "normal_force_over_weight", "-")
    text = "from 45° to 70° the load doubles (within 10 %)"
    result.check(
        "(2.2)", text, alpha(70), "normal_force_over_weight", between=(1.8, 2.2), over=over, derived=True
    )
    result.add("(2.1), Fig. 2.5", "γ at a row spacing of 6 mm", "rows 6 mm apart", "wobble_deg", unit="deg")
    text = "without tilt the level share falls as cos α: at 80° below a quarter of that at 45°"
    over = (alpha(45), "translation_share_without_tilt", "-")
    result.check(
        "2.3.2", text, alpha(80), "translation_share_without_tilt", at_most=0.25, over=over, derived=True
    )
    text = "orthogonal wheels keep the level share at √(2/3) at every latitude (80°)"
    result.check("2.3.2", text, alpha(80), "translation_torque_share", between=(0.8164, 0.8166), derived=True)
    for latitude in (60, 80):
        what = f"level share at {latitude}°"
        result.add("2.3.2", f"{what}, β = 0", alpha(latitude), "translation_share_without_tilt")
        result.add("2.3.2", f"{what}, orthogonal", alpha(latitude), "translation_torque_share")
    draw(data, out_dir)
    result.pictures.append("geometry")
    return result


def draw(data: Data, out_dir: Path) -> None:
    def over_latitude(quantity: str) -> list[float]:
        return [data.statistic(alpha(a), quantity) for a in LATITUDES]

    spacing_mm = np.linspace(0.0, 12.0, 49)
    wobble = np.degrees(np.arcsin(spacing_mm * 1e-3 / (2 * BALL_RADIUS_M)))
    with plt.rc_context(style.RC):
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
        left.plot(LATITUDES, over_latitude("beta_deg"), color=style.ESTIMATE, label="closed form")
        left.plot(TABLE_2_1.keys(), TABLE_2_1.values(), "o", color=style.REFERENCE, label="[T] Table 2.1")
        left.set(xlabel="latitude α, deg", ylabel="tilt β, deg", title="Orthogonal wheels")
        left.legend(loc="lower right")
        for i, (quantity, label, dash) in enumerate(
            (
                ("normal_force_over_weight", "load / weight", "-"),
                ("translation_torque_share", "level share, orthogonal", "-"),
                ("translation_share_without_tilt", "level share, β = 0", "--"),
                ("yaw_torque_share", "upright share, orthogonal", "-"),
                ("yaw_share_without_tilt", "upright share, β = 0", "--"),
            )
        ):
            middle.plot(LATITUDES, over_latitude(quantity), dash, color=style.colour(i), label=label)
        middle.set(xlabel="latitude α, deg", title="Load and shares of a wheel's torque", ylim=(0, 2.6))
        middle.legend(loc="upper left", fontsize=7)
        right.plot(spacing_mm, wobble, color=style.ESTIMATE)
        right.plot([6], [data.statistic("rows 6 mm apart", "wobble_deg")], "o", color=style.REFERENCE)
        right.set(xlabel="distance of the rows, mm", ylabel="γ, deg", title="Wobble (2.1)")
        style.save(figure, out_dir / "geometry")
