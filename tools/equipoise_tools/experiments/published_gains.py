"""6.2, 6.3: do the published gains and signs balance the planar model? (6.13), (6.22), (6.27), (6.29), "
"Fig. 6.3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.linalg import expm

from .. import published, style
from ..style import plt
from .data import TRACE_HZ, Data, Ran
from .framework import Result
from .runs import Lab

COVERS = ("(6.13)", "(6.22)", "(6.27)", "(6.29)", "Table 6.3, planar", "Fig. 6.3")
DT_S = 0.005
# theta'', phi'' = row . (theta, theta', phi', u): (5.28) as published, and the exact model's (errata.md).
MODELS = {
    "(5.28) as published": (
        published.table()["(5.28)"]["theta_ddot"],
        published.table()["(5.28)"]["phi_ddot"],
    ),
    "derived": ((129.1, -9.09, 9.09, -133.0), (-277.4, 34.4, -34.4, 501.6)),
}
FIXED = ("(6.22)", "(6.27)", "(6.29)")


def published_rows() -> dict[str, tuple]:
    """c1, c2, c3, c4, SLC gain and pole, low-pass filter in rad/s (0: none)."""
    keys = ("c1", "c2", "c3", "c4", "slc_gain", "slc_pole")
    rows = {name: (*(published.table()[name][key] for key in keys), 0.0) for name in FIXED}
    scheduled = published.table()["Table 6.3"]
    for i, hz in enumerate(scheduled["yaw_hz"]):
        corner = published.table()["6.2.1"]["low_pass_rad_s"][i]
        rows[f"Table 6.3, {hz:g} Hz"] = (*(scheduled[key][i] for key in keys), corner)
    return rows


GAINS = published_rows()
SLC_UNIT = published.table()["(6.13)"]["slc_unit_rad_per_rad_s"]
SIGNS = {"-": -1.0, "+": 1.0}


def plant(model: str) -> tuple[np.ndarray, np.ndarray]:
    """Zero-order hold of theta, phi, theta', phi'."""
    (a, b, c, d), (e, f, g, h) = MODELS[model]
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [a, 0, b, c], [e, 0, f, g]], dtype=float)
    B = np.array([[0], [0], [d], [h]], dtype=float)
    held = expm(np.block([[A, B], [np.zeros((1, 5))]]) * DT_S)
    return held[:4, :4], held[:4, 4:]


def growth_rate(model: str, gains: tuple) -> float:
    """Sum of the continuous poles, 1/s, of (6.10) without SLC and low-pass: above 0, one of them is "
    "unstable."""
    (_, b, _, d), (_, _, g, h) = MODELS[model]
    return b + g + d * gains[2] + h * gains[3]


def closed_loop(model: str, gains: tuple, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """(M, N) of s+ = M s + N v_ref; s = theta, phi - phi_ref, theta', phi', theta_ref, theta_ref "
    "before, low-pass."""
    c1, c2, c3, c4, slc, pole, corner = gains
    F, G = plant(model)
    keep = np.exp(-corner * DT_S) if corner else 0.0
    theta, phi, theta_dot, phi_dot, lean, before, low = np.eye(7)
    # Errors of (6.7)-(6.9); v_ref enters by the speed error.
    low_next = keep * low - (1 - keep) * phi_dot
    u = -(c1 * (lean - theta) - c2 * phi + c3 * ((lean - before) / DT_S - theta_dot) + c4 * low_next)
    u_ref = -c4 * (1 - keep)
    M = np.zeros((7, 7))
    M[:4, :4] = F
    M[:4] += G @ u[None, :]
    M[4] = pole * lean - sign * slc * SLC_UNIT * phi_dot
    M[5] = lean
    M[6] = low_next
    N = np.zeros(7)
    N[:4] = (G * u_ref)[:, 0]
    N[1] -= DT_S
    N[4] = sign * slc * SLC_UNIT
    N[6] = 1 - keep
    return M, N


def measure(lab: Lab) -> Data:
    data = Data()
    for name, gains in GAINS.items():
        for model in MODELS:
            ran = Ran(control="thesis as published", world=f"planar model {model}", gains=f"[T] {name}")
            data.add(f"{name}, {model}", "sum_of_poles_1_s", growth_rate(model, gains), ran)
            for label, sign in SIGNS.items():
                control = "thesis as published" if sign < 0 else "thesis corrected"
                ran = Ran(control=control, world=f"planar model {model}", gains=f"[T] {name}")
                M, _ = closed_loop(model, gains, sign)
                radius = float(np.abs(np.linalg.eigvals(M)).max())
                data.add(f"{name}, {model}, SLC {label}", "spectral_radius", radius, ran)
    M, N = closed_loop("derived", GAINS["Table 6.3, 0.5 Hz"], 1.0)
    state, thetas, speeds = np.zeros(7), [], []
    speed_ref = 0.2 / 0.032
    for _ in range(int(4 / DT_S)):
        thetas.append(state[0])
        speeds.append(state[3])
        state = M @ state + N * speed_ref
    every = int(1 / TRACE_HZ / DT_S) // 5
    data.traces["speed step", "theta"] = np.round(thetas, 5)[::every]
    data.traces["speed step", "speed"] = np.round(np.array(speeds) * 3.2, 4)[::every]
    ran = Ran(control="thesis corrected", world="planar model derived", gains="[T] Table 6.3, 0.5 Hz")
    first = np.array(speeds[: int(0.5 / DT_S)]) * 3.2
    data.add("speed step", "lowest_speed_in_half_a_second_cm_s", first.min(), ran)
    data.add("speed step", "largest_lean_in_a_second_rad", max(thetas[: int(1 / DT_S)]), ran)
    return data


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Published gains and signs on the planar model ((6.13), (6.22), (6.27), (6.29), Fig. 6.3)",
        command="tools/experiments published_gains",
        method="Feedback (6.10) with the SLC (6.13) and the low-pass, at 200 Hz, on the planar model "
        "with held inputs: "
        "(5.28) as published, and with the coefficients that the exact model has (410 there is 502). A "
        "spectral radius "
        "above 1 falls. The sum of the poles of the feedback alone decides without any doubt: above 0, "
        "unstable.",
        differs="the momentum about the contact, (m11+m14) theta'' + (m14+m44) phi'' = m g l theta, must "
        "not see the "
        "motor's torque; only 502 cancels. With 410 every design looks stable, with either sign.",
        data=data,
    )
    for name in ("(6.22)", "(6.27)"):
        case = f"{name}, (5.28) as published"
        result.add(name, "sum of the closed loop's poles", case, "sum_of_poles_1_s", unit="1/s")
        text = f"the gains {name} balance the published planar model"
        result.check(name, text, case, "sum_of_poles_1_s", at_most=0.0, derived=True)
    for name in GAINS:
        target = name if name in COVERS else "Table 6.3, planar"
        for model in MODELS:
            for label in SIGNS:
                case = f"{name}, {model}, SLC {label}"
                what = f"spectral radius, {name}, {model}, sign {label}"
                result.add(target, what, case, "spectral_radius")
    for label, claim in (("-", "[T]"), ("+", "ours")):
        text = f"the gains (6.29) balance the robot of Table 5.2, sign {label} in (6.13)"
        case = f"(6.29), derived, SLC {label}"
        result.check("(6.29)", text, case, "spectral_radius", at_most=1.0, derived=True, claim=claim)
    for hz in published.table()["Table 6.3"]["yaw_hz"]:
        name = f"Table 6.3, {hz:g} Hz"
        text = f"the gains of Table 6.3 at {hz:g} Hz balance the planar model"
        result.check("Table 6.3, planar", text, f"{name}, derived, SLC +", "spectral_radius", at_most=1.0)
        text = f"(6.13) with its published sign balances (5.28), {name}"
        result.check(
            "(6.13)",
            text,
            f"{name}, (5.28) as published, SLC -",
            "spectral_radius",
            at_most=1.0,
            claim="ours",
        )
        text = f"(6.13) with its published sign balances the robot of Table 5.2, {name}"
        result.check("(6.13)", text, f"{name}, derived, SLC -", "spectral_radius", at_most=1.0, derived=True)
        text = f"with the sign turned it balances, {name}"
        result.check("(6.13)", text, f"{name}, derived, SLC +", "spectral_radius", at_most=1.0, claim="ours")
    quantity = "lowest_speed_in_half_a_second_cm_s"
    result.add("Fig. 6.3", "lowest speed after a step of +20 cm/s", "speed step", quantity, unit="cm/s")
    text = "the ball first moves against the command"
    result.check("Fig. 6.3", text, "speed step", quantity, at_most=-0.1)
    text = "the body tilts into the travel"
    result.check("Fig. 6.3", text, "speed step", "largest_lean_in_a_second_rad", at_least=0.001)
    with plt.rc_context(style.RC):
        figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
        for axes, series, label in ((left, "speed", "speed, cm/s"), (right, "theta", "θ, rad")):
            values = data.trace("speed step", series)
            axes.plot(np.arange(values.size) / (5 * TRACE_HZ), values, color=style.ESTIMATE)
            axes.axhline(20.0 if series == "speed" else 0.0, color=style.REFERENCE, ls="--", lw=0.9)
            axes.set(xlabel="time, s", ylabel=label)
        left.set_title("Step of the speed reference, planar model, Table 6.3 at 0.5 Hz")
        style.save(figure, out_dir / "fig_6_3")
    result.pictures.append("fig_6_3")
    return result
