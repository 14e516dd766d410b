"""6.2, 6.3: do the printed gains and signs balance the planar model? (6.13), (6.22), (6.27), (6.29), "
"Fig. 6.3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.linalg import expm

from .. import style
from ..style import plt
from .data import TRACE_HZ, Data, Ran
from .framework import Result
from .runs import Lab

COVERS = ("(6.13)", "(6.22)", "(6.27)", "(6.29)", "Table 6.3, planar", "Fig. 6.3")
DT_S = 0.005
# theta'', phi'' = row . (theta, theta', phi', u): (5.28) as printed, and the exact model's (errata.md).
MODELS = {
    "(5.28) as printed": ((130, -8.9, 8.9, -130), (-280, 34, -34, 410)),
    "derived": ((129.1, -9.09, 9.09, -133.0), (-277.4, 34.4, -34.4, 501.6)),
}
# c1, c2, c3, c4, SLC gain and pole, low-pass in rad/s (0: none).
GAINS = {
    "(6.22)": (14, 2, 0.6, 1.2, 0.25, 0.961, 0),
    "(6.27)": (8.5, 0.3, 0.4, 0.65, 0.2, 0.961, 0),
    "(6.29)": (6.4, 0.19, 0.13, 0.0125, 0.39, 0.961, 0),
    "Table 6.3, 0 Hz": (10, 0.4, 0.5, 0.075, 0.20, 0.970, 10),
    "Table 6.3, 0.5 Hz": (12, 0.4, 0.5, 0.10, 0.20, 0.968, 10),
    "Table 6.3, 0.75 Hz": (14, 0.4, 0.6, 0.10, 0.15, 0.963, 10),
    "Table 6.3, 1 Hz": (14, 0.5, 0.6, 0.085, 0.10, 0.960, 15),
    "Table 6.3, 1.5 Hz": (12, 0.6, 0.5, 0.060, 0.10, 0.951, 20),
}
SLC_UNIT = 0.000985
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
            ran = Ran(control="thesis as printed", world=f"planar model {model}", gains=f"[T] {name}")
            data.add(f"{name}, {model}", "sum_of_poles_1_s", growth_rate(model, gains), ran)
            for label, sign in SIGNS.items():
                control = "thesis as printed" if sign < 0 else "thesis corrected"
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
        title="Printed gains and signs on the planar model ((6.13), (6.22), (6.27), (6.29), Fig. 6.3)",
        command="tools/experiments printed_gains",
        method="Feedback (6.10) with the SLC (6.13) and the low-pass, at 200 Hz, on the planar model "
        "with held inputs: "
        "(5.28) as printed, and with the coefficients that the exact model has (410 there is 502). A "
        "spectral radius "
        "above 1 falls. The sum of the poles of the feedback alone decides without any doubt: above 0, "
        "unstable.",
        differs="the momentum about the contact, (m11+m14) theta'' + (m14+m44) phi'' = m g l theta, must "
        "not see the "
        "motor's torque; only 502 cancels. With 410 every design looks stable, with either sign.",
        data=data,
    )
    for name in ("(6.22)", "(6.27)"):
        case = f"{name}, (5.28) as printed"
        result.add(name, "sum of the closed loop's poles", case, "sum_of_poles_1_s", unit="1/s")
        text = f"the gains {name} balance the printed planar model"
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
    for hz in (0, 0.5, 0.75, 1):
        name = f"Table 6.3, {hz:g} Hz"
        text = f"the gains of Table 6.3 at {hz:g} Hz balance the planar model"
        result.check("Table 6.3, planar", text, f"{name}, derived, SLC +", "spectral_radius", at_most=1.0)
        text = f"(6.13) with its printed sign balances (5.28), {name}"
        result.check(
            "(6.13)", text, f"{name}, (5.28) as printed, SLC -", "spectral_radius", at_most=1.0, claim="ours"
        )
        text = f"(6.13) with its printed sign balances the robot of Table 5.2, {name}"
        result.check("(6.13)", text, f"{name}, derived, SLC -", "spectral_radius", at_most=1.0, derived=True)
        text = f"with the sign turned it balances, {name}"
        result.check("(6.13)", text, f"{name}, derived, SLC +", "spectral_radius", at_most=1.0, claim="ours")
    quantity = "lowest_speed_in_half_a_second_cm_s"
    result.add("Fig. 6.3", "lowest speed after a step of +20 cm/s", "speed step", quantity, unit="cm/s")
    text = "the ball first moves against the command"
    result.check("Fig. 6.3", text, "speed step", quantity, at_most=-0.1)
    text = "the body leans into the travel"
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
