"""config/generated/mbbr_filter.hpp: one step of the MBBR's default filter as straight-line code."""

from __future__ import annotations

import sympy as sp

from . import emit, mbbr, mbbr_header
from .straight import Covariance, Emitter, correct, midpoint, total

INPUTS = (*mbbr_header.INPUTS, "straight.py", "mbbr_filter.py")
DT = 0.005
# Order of the states here: what moves, what the encoders sum, what is constant. ORDER: the place in MbbrEkfModel.
NAMES = "tx ty dtx dty dtz px py ex ey ez mx my bx by ux uy uz".split()
ORDER = [0, 1, 5, 6, 7, 8, 9, 2, 3, 4, 10, 11, 12, 13, 14, 15, 16]
N = len(NAMES)
AT = {name: i for i, name in enumerate(NAMES)}
# Where a unit of u moves the observable states within a tick, upright: (state, input).
B_PLACES = [
    (AT[s], i) for i, states in enumerate((("tx", "dtx", "px", "ex"), ("ty", "dty", "py", "ey"), ("dtz", "ez"))) for s in states
]


def _rows(index: int):
    """Rows of the small-angle model with named coefficients, and their Jacobian."""
    model = mbbr_header.model()
    rows = model.rows[index]
    symbolic = [
        sum(sp.Symbol(f"c.{name}_{label}") * monomial for label, monomial, _ in model.terms(e))
        for name, e in zip(rows.names, rows.expressions, strict=True)
    ]
    return symbolic, [[sp.diff(e, v) for v in mbbr.STATE] for e in symbolic]


def _evaluate(em: Emitter, rows, values: dict):
    """Outputs and Jacobian; outputs are affine in the small states."""
    symbolic, jacobian = rows
    J = [[em.of(e, values) for e in row] for row in jacobian]
    outputs = []
    for e, row in zip(symbolic, J, strict=True):
        rest = em.of(e.subs(dict.fromkeys(mbbr.SMALL, 0)), values)
        small = [row[j] * values[v] for j, v in enumerate(mbbr.STATE) if v in mbbr.SMALL]
        outputs.append(total([*small, rest]))
    return outputs, J


def _derivative(em: Emitter, rows, u):
    def of(x):
        values = dict(zip((*mbbr.STATE, *mbbr.INPUT), (*x[:7], *u), strict=True))
        a, J = _evaluate(em, rows, values)
        tx, ty, dtx, dty, dtz, px, py = x[:7]
        a[3], a[4] = a[3] + dtz * py, a[4] - dtz * px  # phi*' lives in a frame that turns
        J[3][4], J[3][6] = J[3][4] + py, J[3][6] + dtz
        J[4][4], J[4][5] = J[4][4] - px, J[4][5] - dtz
        one = em.constant(1.0)
        A = {(0, 2): one, (1, 3): one}
        A |= {(2 + i, j): J[i][j] for i in range(5) for j in range(7)}
        A |= {(7, 5): one, (7, 1): dtz, (7, 4): ty}  # [T] (5.31)
        A |= {(8, 6): one, (8, 0): -dtz, (8, 4): -tx}
        A |= {(9, 4): -one, (9, 1): px, (9, 0): -py, (9, 5): ty, (9, 6): -tx}
        sums = [px + ty * dtz, py - tx * dtz, ty * px - tx * py - dtz]
        return [dtx, dty, *a, *sums], A

    return of


def _state(em: Emitter):
    return [em.variable(f"x[{i}]") for i in ORDER]


def predict() -> list[str]:
    em = Emitter()
    x = _state(em)
    u = [em.variable(f"u[{i}]") + x[AT["ux"] + i] for i in range(3)]
    after, F = midpoint(x[:10], _derivative(em, _rows(0), u), DT)
    one = em.constant(1.0)
    turn = DT * x[AT["dtz"]]
    keep = em.variable("k.keep")
    c, s = keep * em.call("std::cos", turn), keep * em.call("std::sin", turn)
    d = x[AT["ux"] :]
    P = Covariance(em, "P", N)
    B = {place: em.variable(f"k.B[{i}]") for i, place in enumerate(B_PLACES)}
    moved = range(7)
    for i in range(7, 10):
        row = {j: F[i, j] for j in moved if (i, j) in F}
        P.transform({i: {**row, i: one, **{AT["ux"] + b: v for (r, b), v in B.items() if r == i}}})
    zero = em.constant(0.0)
    P.propagate({(i, j): F.get((i, j), zero) + (1.0 if i == j else 0.0) for i in moved for j in moved}, moved)
    for i in moved:
        row = {AT["ux"] + b: v for (r, b), v in B.items() if r == i}
        P.transform({i: {i: one, **row}})
    ux, uy, uz = range(AT["ux"], N)
    P.transform({ux: {ux: c, uy: s}, uy: {ux: -s, uy: c}})
    P.transform({uz: {uz: keep}})
    for place, (i, j) in enumerate(noise_places()):
        P[i, j] = P[i, j] + em.variable(f"k.Q[{place}]")
    for i, value in zip(ORDER, after, strict=False):
        em.store(f"x[{i}]", value)
    for i, value in zip(ORDER[AT["ux"] :], (c * d[0] + s * d[1], c * d[1] - s * d[0], keep * d[2]), strict=True):
        em.store(f"x[{i}]", value)
    P.store()
    return em.lines()


def noise_places() -> list[tuple[int, int]]:
    """Where Q has entries: the diagonal, and what one input moves together."""
    pairs = {(i, i) for i in range(N)}
    for b in range(3):
        states = sorted(r for r, i in B_PLACES if i == b)
        pairs |= {(i, j) for i in states for j in states if i <= j}
    return sorted(pairs)


def update() -> list[str]:
    em = Emitter()
    x = _state(em)
    tx, ty, dtx, dty, dtz = x[:5]
    ex, ey, ez, mx, my, bx, by = x[7:14]
    u = [em.variable(f"u[{i}]") + x[AT["ux"] + i] for i in range(3)]
    values = dict(zip((*mbbr.STATE, *mbbr.INPUT), (*x[:7], *u), strict=True))
    accel, J = _evaluate(em, _rows(1), values)
    one = em.constant(1.0)
    rate = [dtx - ty * dtz, dty + tx * dtz, dtz - tx * dty]
    across = 1.0 - 0.5 * (mx * mx + my * my)
    # Gyro through the mount; products of small states are left out of the Jacobian.
    rows = [
        {AT["dtx"]: one, AT["ty"]: -dtz, AT["dtz"]: -ty - my, AT["bx"]: one, AT["my"]: -rate[2]},
        {AT["dty"]: one, AT["tx"]: dtz, AT["dtz"]: tx + mx, AT["by"]: one, AT["mx"]: rate[2]},
        {
            AT["dtz"]: across,
            AT["tx"]: -dty - mx * dtz,
            AT["ty"]: -my * dtz,
            AT["dty"]: -tx - mx,
            AT["dtx"]: my,
            AT["mx"]: -rate[1] - mx * rate[2],
            AT["my"]: rate[0] - my * rate[2],
        },
    ]
    expected = [rate[0] + bx - my * rate[2], rate[1] + by + mx * rate[2], rate[2] * across - mx * rate[1] + my * rate[0]]
    phi_B = [ex - tx, ey - ty, ez]
    for i in range(3):
        w = [em.variable(f"k.wheels[{3 * i + j}]") for j in range(3)]
        rows.append({AT["ex"]: w[0], AT["ey"]: w[1], AT["ez"]: w[2], AT["tx"]: -w[0], AT["ty"]: -w[1]})
        expected.append(total(a * b for a, b in zip(w, phi_B, strict=True)))
    g = em.variable("k.g")
    for i, (mount, sign, force) in enumerate((("my", 1, "uy"), ("mx", -1, "ux"))):
        arm = em.variable(f"k.lever_arm[{i}]")
        row = {j: J[i][j] for j in range(7)}
        row[AT["dtz"]] = row[AT["dtz"]] + 2.0 * dtz * arm
        row[AT[mount]] = g if sign > 0 else -g
        row[AT[force]] = em.variable(f"k.c.accel_{'xy'[i]}_{force}")
        rows.append(row)
        m = x[AT[mount]]
        expected.append(accel[i] + g * (m if sign > 0 else -m) + dtz * dtz * arm)
    P = Covariance(em, "P", N)
    residuals = [em.variable(f"y[{i}]") - e for i, e in enumerate(expected)]
    for i, value in enumerate(correct(em, P, rows, residuals)):
        em.store(f"x[{ORDER[i]}]", x[i] + value)
    P.store()
    return em.lines()


def render() -> str:
    triangle = N * (N + 1) // 2
    places = noise_places()
    model = ", ".join(f"{{{ORDER[i]}, {ORDER[j]}}}" for i, j in places)
    inputs = ", ".join(f"{{{ORDER[i]}, {j}}}" for i, j in B_PLACES)
    order = ", ".join(map(str, ORDER))
    body = [
        f"inline constexpr int kStates = {N};",
        f"inline constexpr int kTriangle = {triangle};  // of P, packed by rows in the order kOrder",
        *emit.statement(f"inline constexpr int kOrder[kStates] = {{{order}}};", 0),
        f"inline constexpr int kNoises = {len(places)};  // entries of Q, (row, column) in the model's order",
        *emit.statement(f"inline constexpr int kNoise[kNoises][2] = {{{model}}};", 0),
        f"inline constexpr int kInputs = {len(B_PLACES)};  // entries of B, (state, input)",
        *emit.statement(f"inline constexpr int kInput[kInputs][2] = {{{inputs}}};", 0),
        "",
        "struct Constants {",
        "  mbbr::Coefficients<double> c;",
        "  double wheels[9];     // wheel angles from the ball's, rows",
        "  double lever_arm[2];  // x, y of the IMU",
        "  double g;",
        "  double keep;  // of the disturbance, per tick",
        "  double B[kInputs];",
        "  double Q[kNoises];",
        "  double R[8];",
        "};",
        "",
        "/// x, P after a tick with input u.",
        "inline void predict(const Constants& k, const double u[3], double x[kStates], double P[kTriangle]) noexcept {",
        *predict(),
        "}",
        "",
        "/// x, P after the samples y, of which those count whose flag is set; row_nis: squared innovation over variance.",
        "inline void update(const Constants& k, const double u[3], const double y[8], const bool use[8],",
        "                   double x[kStates], double P[kTriangle], double row_nis[8]) noexcept {",
        *update(),
        "}",
        "",
    ]
    about = [
        "One step of the MBBR's default filter, straight-line: midpoint prediction, F P F' as row operations on a packed",
        "triangle, eight scalar measurements with masks instead of branches. States as in MbbrEkfModel, which is the",
        "readable form and the reference in tests. SI, rad. Source: docs/derivation.md. RT-safe.",
    ]
    text = emit.header(
        about,
        "mbbr_filter.py",
        emit.input_hash(*INPUTS),
        "equipoise::generated::mbbr_filter",
        body,
    )
    return text.replace("#include <cmath>\n", '#include <cmath>\n\n#include "generated/mbbr_model.hpp"\n')
