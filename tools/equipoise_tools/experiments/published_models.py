"""Published models beside the exact plant: (3.41)-(3.52), 4.4, (5.28)-(5.33), (6.10), (6.25)."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
from scipy import signal

from .. import published, style
from ..style import plt
from .data import Data, Ran
from .framework import Result
from .runs import BUILT, NO_GATES, Case, Lab, equipoise_json

COVERS = (
    "(3.41), (3.42)", "(3.43), (3.47)", "(3.50), (3.51)", "(3.52)", "4.4", "(5.28)", "(5.29)",
    "(5.31), (5.33)", "(5.32)", "(6.10), Fig. 6.2", "(6.25)",
)  # fmt: skip
ROUNDING = 0.025  # of two published digits
EXACT = Ran(world="exact plant")
SMALL = 1e-4
SPIN_RAD_S, BALL_RAD_S = 2 * np.pi, 6.25  # 1 Hz, 20 cm/s
T_R, STALL = 0.289, 1.0  # (6.16); currents over the stall current
LOOPS = {"200 Hz": 0.005, "100 Hz": 0.01}
SPINNING = {
    "controller": "thesis",
    "estimator": "truth",
    "yaw_hz": 1.0,
    "duration_s": 60.0,
    "fidelity": BUILT,
}
TABLE_6_3 = published.gains("Table 6.3")
AS_FIG_6_2 = {**NO_GATES, **published.control(), **TABLE_6_3, "reference.slc_sign": 1.0}


def exact(robot: str, rows: list[dict]) -> list[dict]:
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        request = Path(folder) / "rows.json"
        request.write_text(json.dumps({"rows": rows}))
        return equipoise_json("model", "--robot", robot, "--in", request)["rows"]


def mbbr(theta_x=0.0, theta_y=0.0, rate_x=0.0, turn=0.0, ball_x=0.0, ball_y=0.0, u_x=0.0) -> dict:
    """A state of the MBBR; torque as (5.13), back-EMF and viscous friction included."""
    table, friction = published.table()["Table 5.2"], published.table()["5.3"]
    drag = table["k2_ball_N_m_s"] + friction["viscous_friction_N_m_s"]
    encoder = np.array([ball_x - rate_x, ball_y, -turn])
    tau = table["k1_N_m"] * np.array([u_x, 0.0, 0.0]) - drag * encoder
    return {
        "theta_xy": [theta_x, theta_y], "theta_dot": [rate_x, 0.0, turn], "phi_star_dot": [ball_x, ball_y],
        "tau_B": tau.tolist(),
    }  # fmt: skip


def mip(theta=0.0, ball=0.0, turn=0.0, u_x=0.0, u_z=0.0) -> dict:
    return {"theta": theta, "theta_dot": 0.0, "phi_dot": ball, "psi_dot": turn, "u_x": u_x, "u_z": u_z}


def slopes(robot: str, variables: dict[str, dict], outputs) -> dict[str, np.ndarray]:
    """Change of outputs(row) per unit of each variable, from states that differ by +-SMALL."""
    states = [make for pair in variables.values() for make in (pair["plus"], pair["minus"])]
    rows = [outputs(row) for row in exact(robot, states)]
    return {name: (rows[2 * i] - rows[2 * i + 1]) / (2 * SMALL) for i, name in enumerate(variables)}


def around(make, names: tuple[str, ...]) -> dict[str, dict]:
    return {name: {"plus": make(**{name: SMALL}), "minus": make(**{name: -SMALL})} for name in names}


def coefficients(data: Data) -> None:
    """`off`: published over exact, less 1; one row per published digit."""

    def note(case: str, ours: float, theirs: float) -> None:
        data.add(case, "exact", ours, EXACT)
        data.add(case, "published_off_by", abs(theirs / ours - 1.0), EXACT)

    table = published.table()
    names = ("theta_x", "rate_x", "ball_x", "u_x")
    found = slopes(
        "mbbr", around(mbbr, names), lambda row: np.array([row["qdd"][0], row["qdd"][3], row["accel_B"][1]])
    )
    for i, name in enumerate(names):
        note(f"(5.28) theta'' by {name}", found[name][0], table["(5.28)"]["theta_ddot"][i])
        note(f"(5.28) phi'' by {name}", found[name][1], table["(5.28)"]["phi_ddot"][i])
        note(f"(5.29) by {name}", found[name][2], table["(5.29)"]["accel"][i])
    names = ("theta", "ball", "u_x")
    found = slopes("mip", around(mip, names), lambda row: np.array([*row["qdd"][:2], row["accel_B"][1]]))
    step = table["Table 3.2"]["period_s"]
    for i, (name, at) in enumerate(zip(names, (0, 1, 3), strict=True)):
        unit = 1.0 if name == "ball" else 0.0
        note(f"(3.41) by {name}", step * found[name][0], table["(3.41)"]["theta_dot"][at])
        note(f"(3.42) by {name}", unit + step * found[name][1], table["(3.42)"]["phi_dot"][(0, 1, 3)[i]])
        note(f"(3.47) by {name}", found[name][2], table["(3.47)"]["accel_y"][(1, 2, 0)[i]])
    turned = exact(
        "mip", [mip(theta=SMALL, turn=5.0), mip(theta=-SMALL, turn=5.0), mip(theta=SMALL), mip(theta=-SMALL)]
    )
    by_turn = [np.array([*row["qdd"][:2]]) for row in turned]
    per = ((by_turn[0] - by_turn[1]) - (by_turn[2] - by_turn[3])) / (2 * SMALL * 25.0) * step
    note("(3.41) by theta psi'^2", per[0], table["(3.41)"]["theta_dot"][2])
    note("(3.42) by theta psi'^2", per[1], table["(3.42)"]["phi_dot"][2])
    still, spun, driven = (row["qdd"][2] for row in exact("mip", [mip(), mip(turn=SMALL), mip(u_z=SMALL)]))
    note("(3.43) by psi'", 1.0 + step * (spun - still) / SMALL, table["(3.43)"]["psi_dot"][0])
    note("(3.43) by u_z", step * (driven - still) / SMALL, table["(3.43)"]["psi_dot"][1])
    turning, tilted = exact(
        "mbbr", [mbbr(turn=SPIN_RAD_S, ball_y=BALL_RAD_S), mbbr(theta_x=0.05, turn=SPIN_RAD_S)]
    )
    f9 = -0.0062 * SPIN_RAD_S * BALL_RAD_S  # (5.32) upright, rolling along one axis
    data.add("(5.32) f9, 1 Hz and 20 cm/s", "exact", turning["qdd"][3], EXACT)
    data.add("(5.32) f9, 1 Hz and 20 cm/s", "published", f9, EXACT)
    data.add("(5.32) f9, 1 Hz and 20 cm/s", "share_of_exact", f9 / turning["qdd"][3], EXACT)
    data.add("(5.33) h2, tilt 0.05 rad at 1 Hz", "exact", tilted["gyro_B"][1], EXACT)
    data.add(
        "(5.33) h2, tilt 0.05 rad at 1 Hz", "share_of_exact", 0.0, EXACT
    )  # theta_y theta_z', theta_y = 0
    ramp = 0.2 * np.arange(5) / 120.0
    data.add("(6.25) of a ramp", "over_the_slope", float((ramp[3] - ramp[1]) * 120.0 / 0.2), Ran())


def loop_radius(period_s: float) -> float:
    """Spectral radius of u = D1 (D2 (-phi) - theta), (3.50), (3.51), on the exact plant upright at rest."""
    found = slopes("mip", around(mip, ("theta", "ball", "u_x")), lambda row: np.array(row["qdd"][:2]))
    A, b = np.zeros((4, 4)), np.zeros((4, 1))  # theta, phi, theta', phi'
    A[0, 2] = A[1, 3] = 1.0
    A[2:, 0], A[2:, 3], b[2:, 0] = found["theta"], found["ball"], found["u_x"]
    F, g, *_ = signal.cont2discrete((A, b, np.eye(4), np.zeros((4, 1))), period_s)
    inner, outer = (published.table()[where] for where in ("(3.50)", "(3.51)"))
    A1, B1, C1, D1 = signal.tf2ss(inner["numerator"], inner["denominator"])
    A2, B2, C2, D2 = signal.tf2ss(outer["numerator"], outer["denominator"])
    x, theta, phi, x1, x2 = (np.eye(8)[rows] for rows in (slice(4), [0], [1], slice(4, 6), slice(6, 8)))
    error = C2 @ x2 - D2 @ phi - theta
    plant = F @ x + g @ (C1 @ x1 + D1 @ error)
    closed = np.vstack([plant, A1 @ x1 + B1 @ error, A2 @ x2 - B2 @ phi])
    return float(np.max(np.abs(np.linalg.eigvals(closed))))


def loops(data: Data) -> None:
    for name, period_s in LOOPS.items():
        data.add(f"(3.50), (3.51) at {name}", "spectral_radius", loop_radius(period_s), EXACT)
    (a, b), (k, k_rate) = published.table()["(3.43)"]["psi_dot"], published.table()["(3.52)"]["gains"]
    heading = np.array([[1.0, published.table()["Table 3.2"]["period_s"]], [-b * k, a - b * k_rate]])
    radius = float(np.max(np.abs(np.linalg.eigvals(heading))))
    data.add("(3.52) on (3.43)", "spectral_radius", radius, Ran())


def iterations(target: float, speed: float) -> int:
    """Of (4.31)-(4.34) to 1e-3 of the duty, for a positive target over the stall current."""

    def current(v: float) -> float:
        grown = np.exp(v * T_R)
        inside = grown * (1 + speed) / (2 * grown - 1 + speed)
        return v * (1 - speed) + (1 + speed) / T_R * np.log(inside)  # (4.30)

    def slope(v: float) -> float:
        grown = np.exp(v * T_R)
        return 2 * (grown - 1) * (1 - speed) / (2 * grown + speed - 1)  # (4.32)

    v = np.log((np.exp(T_R) * (1 + speed) + 1 - speed) / 2) / (2 * T_R)  # (4.34)
    for done in range(1, 51):
        change = (current(v) - target) / slope(v)
        v = float(np.clip(v - change, 1e-6, 1.0))
        if abs(change) < 1e-3:
            return done
    return 51


def newton(data: Data) -> None:
    counts = []
    for speed in np.linspace(-0.9, 0.9, 37):
        edge = np.log((np.exp(T_R) * (1 + speed) + 1 - speed) / 2) / T_R
        highest = 2 * min(edge, 1.0) - 1 - speed  # (4.29) where the current no longer reaches zero
        counts += [
            iterations(share * highest, speed) for share in np.linspace(0.02, 0.98, 25) if highest > 0.01
        ]
    for quantity, value in (("fewest", min(counts)), ("median", np.median(counts)), ("most", max(counts))):
        data.add("(4.31)-(4.34), T_r of the MBBR", quantity, value, Ran(world="(4.30)"))
    share = np.mean([3 <= count <= 5 for count in counts])
    data.add("(4.31)-(4.34), T_r of the MBBR", "share_within_3_to_5", share, Ran(world="(4.30)"))
    data.add(
        "(4.31)-(4.34), T_r of the MBBR",
        "share_within_5",
        np.mean(np.array(counts) <= 5),
        Ran(world="(4.30)"),
    )


def cases() -> list[Case]:
    return [
        Case("(6.10), Fig. 6.2 as published", sets=AS_FIG_6_2, options=SPINNING, gains="[T] Table 6.3"),
        Case("the same, corrected", sets={**NO_GATES, **TABLE_6_3}, options=SPINNING, gains="[T] Table 6.3"),
    ]


def measure(lab: Lab) -> Data:
    data = lab.run(cases())
    coefficients(data)
    newton(data)
    loops(data)
    return data


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Published models and formulas ((3.41)-(3.52), 4.4, (5.28)-(5.33), (6.10), (6.25))",
        command="tools/experiments published_models",
        method="Each published coefficient beside the slope of the exact plant of Tables 5.2 and 3.2 "
        "(`equipoise model`), upright at rest; a coefficient holds within 2.5 %, the rounding of two digits. "
        "(5.32), (5.33): the term itself at 1 Hz and 20 cm/s. 4.4: Newton's method of (4.31)-(4.34) to 1e-3 "
        "of the duty over 37 speeds and 25 currents, T_r of (6.16). (6.10), Fig. 6.2: true states in the "
        "built2025 world, 1 Hz in place, (6.13)'s sign turned: Euler rates, filters in the yaw frame, no "
        "feed-forward, commands without limit.",
        differs="errata.md lists what is wrong and how it was found.",
        data=data,
    )
    for case in dict.fromkeys(row["case"] for row in data.rows if row["quantity"] == "published_off_by"):
        where = case.partition(" ")[0]
        target = {"(3.41)": "(3.41), (3.42)", "(3.42)": "(3.41), (3.42)", "(3.43)": "(3.43), (3.47)"}.get(
            where, "(3.43), (3.47)" if where == "(3.47)" else where
        )
        result.add(target, f"exact value, {case}", case, "exact")
        text = f"{case}: the coefficient to its digits"
        result.check(target, text, case, "published_off_by", at_most=ROUNDING, derived=True)
    for target, case, text in (
        ("(5.32)", "(5.32) f9, 1 Hz and 20 cm/s", "f9 is the derivative of phi_x*' within 10 %"),
        ("(5.31), (5.33)", "(5.33) h2, tilt 0.05 rad at 1 Hz", "h2 is the gyro's y axis within 10 %"),
    ):
        result.add(target, f"exact value, {case}", case, "exact")
        result.check(target, text, case, "share_of_exact", between=(0.9, 1.1), derived=True)
    result.check(
        "(6.25)",
        "a ramp's speed within 5 %",
        "(6.25) of a ramp",
        "over_the_slope",
        between=(0.95, 1.05),
        derived=True,
    )
    for target, case, claim in (
        ("(3.50), (3.51)", "(3.50), (3.51) at 200 Hz", "[T]"),
        ("(3.50), (3.51)", "(3.50), (3.51) at 100 Hz", "ours"),
        ("(3.52)", "(3.52) on (3.43)", "[T]"),
    ):
        text = f"{case}: stable"
        result.check(target, text, case, "spectral_radius", at_most=1.0, derived=True, claim=claim)
    case = "(4.31)-(4.34), T_r of the MBBR"
    for quantity in ("fewest", "median", "most", "share_within_3_to_5"):
        result.add("4.4", f"iterations, {quantity.replace('_', ' ')}", case, quantity)
    result.check(
        "4.4", "five iterations are enough in 95 % of the cases", case, "share_within_5", at_least=0.95
    )
    for case, claim in (("(6.10), Fig. 6.2 as published", "[T]"), ("the same, corrected", "ours")):
        result.add("(6.10), Fig. 6.2", f"time upright of 60 s, {case}", case, "upright_s", unit="s")
        text = f"{case}: 1 Hz in place on true states, every run"
        result.check("(6.10), Fig. 6.2", text, case, "held", at_least=1.0, statistic="share", claim=claim)
    draw(out_dir, data)
    result.pictures.append("published_models")
    return result


def draw(out_dir: Path, data: Data) -> None:
    cases_ = list(dict.fromkeys(row["case"] for row in data.rows if row["quantity"] == "published_off_by"))
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
        off = [max(data.statistic(case, "published_off_by"), 1e-4) for case in cases_]
        at = np.arange(len(cases_))
        axes.plot(off, at, "o", color=style.ESTIMATE)
        axes.axvline(ROUNDING, color=style.REFERENCE, ls="--", lw=0.9, label="rounding of two digits")
        axes.set(
            xscale="log", yticks=at, xlabel="published coefficient: relative difference from the exact plant"
        )
        axes.set_yticklabels(cases_, fontsize=7)
        axes.invert_yaxis()
        style.legend_above(figure, axes)
        style.save(figure, out_dir / "published_models")
