"""config/generated/mbbr_filter.*: one step of the MBBR's default filter as straight-line code."""

from __future__ import annotations

from functools import lru_cache

from . import mbbr_header
from .filter_header import DT, Filter, ModelRows, add_noise, ahead
from .packed import Covariance, by_pairs, heun, innovate, restore
from .straight import Emitter, total

INPUTS = (*mbbr_header.INPUTS, "straight.py", "packed.py", "filter_header.py", "mbbr_filter.py")
# As in MbbrEkfModel.
STATES = [
    "tx", "ty", "ex", "ey", "ez", "dtx", "dty", "dtz", "px",
    "py", "mx", "my", "bx", "by", "scale", "ux", "uy", "uz",
]  # fmt: skip
AT = {name: i for i, name in enumerate(STATES)}
N = len(STATES)
SUMS = ("ex", "ey", "ez")
# Torque noise of a tick moves the yaw rate by 0.2 rad/s, the gyro's z knows it to 0.0014.
PRECISE = {2: (AT["dtz"], [AT[s] for s in ("tx", "ty", "dtx", "dty", "dtz", "mx", "my")])}
MOVED = [AT[s] for s in ("tx", "ty", "dtx", "dty", "dtz", "px", "py")]
B = [
    (AT[s], i)
    for i, states in enumerate((("tx", "ex", "dtx", "px"), ("ty", "ey", "dty", "py"), ("ez", "dtz")))
    for s in states
]


def _derivative(em: Emitter, u):
    rows = ModelRows(mbbr_header.model(), 0)

    def of(x, scale):
        tx, ty, _, _, _, dtx, dty, dtz, px, py = x
        a, J = rows.evaluate(em, (tx, ty, dtx, dty, dtz, px, py), u, scale, ((0, 3), (1, 4)))
        one = em.constant(scale)
        turn, px_s, py_s, tx_s, ty_s = (scale * v for v in (dtz, px, py, tx, ty))
        A = {(5 + i, j): J[i][k] for i in range(5) for k, j in enumerate(MOVED)}
        # phi*' lives in a frame that turns.
        a[3], a[4] = a[3] + turn * py, a[4] - turn * px
        A[8, 7], A[8, 9] = A[8, 7] + py_s, A[8, 9] + turn
        A[9, 7], A[9, 8] = A[9, 7] - px_s, A[9, 8] - turn
        A |= {(0, 5): one, (1, 6): one}
        A |= {(2, 8): one, (2, 1): turn, (2, 7): ty_s}  # [T] (5.31)
        A |= {(3, 9): one, (3, 0): -turn, (3, 7): -tx_s}
        A |= {(4, 7): -one, (4, 1): px_s, (4, 0): -py_s, (4, 8): ty_s, (4, 9): -tx_s}
        sums = [px_s + ty * turn, py_s - tx * turn, ty * px_s - tx * py_s - turn]
        return [scale * dtx, scale * dty, *sums, *a], {ij: v for ij, v in A.items() if v.number != 0.0}

    return of


def small_turn(angle):
    """Cosine and sine, as Turn::small() in types.hpp."""
    a2 = angle * angle
    cosine = 1.0 - a2 * (0.5 - a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0)))
    sine = angle * (1.0 - a2 * (1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0))))
    return cosine, sine


def _felt(em: Emitter, x):
    return [em.variable(f"u[{i}]") + x[AT["ux"] + i] for i in range(3)]


def predict() -> Emitter:
    em = Emitter("k.predict")
    x = [em.variable(f"x[{i}]") for i in range(N)]
    after, rows = heun(x[:10], _derivative(em, _felt(em, x)), DT)
    # The sums act on nothing else, so that their step is the true one, scaled; the scale is learnt about z.
    scale = 1.0 + x[AT["scale"]]
    for name in SUMS:
        i = AT[name]
        step = after[i] - x[i]
        after[i] = after[i] + x[AT["scale"]] * step
        del rows[i][i]
        rows[i] = by_pairs([(scale, rows[i])]) | {i: em.constant(1.0)}
    rows[AT["ez"]][AT["scale"]] = step
    for place, (state, i) in enumerate(B):
        rows[state][AT["ux"] + i] = em.variable(f"k.B[{place}]", early=True)
    # A torque that stands in the room turns backwards in the yaw frame.
    keep, turn = em.variable("k.keep", early=True), DT * x[AT["dtz"]]
    cosine, sine = small_turn(turn)
    c, s = keep * cosine, keep * sine
    ux, uy, uz = (AT[u] for u in ("ux", "uy", "uz"))
    felt = {ux: c * x[ux] + s * x[uy], uy: c * x[uy] - s * x[ux], uz: keep * x[uz]}
    P = Covariance(em, "P", N)
    P.transform({AT[name]: rows[AT[name]] for name in SUMS})
    P.store()
    P.transform({i: rows[i] for i in MOVED})
    P.transform({ux: {ux: c, uy: s}, uy: {ux: -s, uy: c}, uz: {uz: keep}})
    add_noise(em, P, B)
    for i, value in {**dict(enumerate(after)), **felt}.items():
        em.store(f"x[{i}]", value)
    P.store()
    return em


def update() -> Emitter:
    em = Emitter("k.innovate")
    x = [em.variable(f"x[{i}]") for i in range(N)]
    tx, ty, ex, ey, ez, dtx, dty, dtz, px, py, mx, my, bx, by, scale = x[:15]
    model = ModelRows(mbbr_header.model(), 1)
    accel, J = model.evaluate(em, (tx, ty, dtx, dty, dtz, px, py), _felt(em, x))
    one, g = em.constant(1.0), em.variable("k.g", early=True)
    scale = 1.0 + scale
    rate = [dtx - ty * dtz, dty + tx * dtz, dtz - tx * dty]
    # A sensor turned by delta sees omega - delta x omega; the yaw rate to the second order.
    shortened = 1.0 - 0.5 * (mx * mx + my * my)
    rows = [
        {"dtx": one, "ty": -dtz, "dtz": -ty - my, "bx": one, "my": -rate[2]},
        {"dty": one, "tx": dtz, "dtz": tx + mx, "by": one, "mx": rate[2]},
        {
            "dtz": shortened,
            "tx": -dty - mx * dtz,
            "ty": -(my * dtz),
            "dty": -tx - mx,
            "dtx": my,
            "mx": -rate[1] - mx * rate[2],
            "my": rate[0] - my * rate[2],
        },
    ]
    expected = [
        rate[0] + bx - my * rate[2],
        rate[1] + by + mx * rate[2],
        rate[2] * shortened - mx * rate[1] + my * rate[0],
    ]
    sums = {"x": {AT["ex"]: one, AT["tx"]: -scale}, "y": {AT["ey"]: one, AT["ty"]: -scale}}
    phi_B = [ex - scale * tx, ey - scale * ty, ez]
    for i in range(3):
        w = [em.variable(f"k.wheels[{3 * i + j}]", early=True) for j in range(3)]
        rows.append(dict(zip(("x", "y", "ez"), w, strict=True)))
        expected.append(total(a * b for a, b in zip(w, phi_B, strict=True)))
    for i, (mount, gravity, force) in enumerate((("my", g, "uy"), ("mx", -g, "ux"))):
        arm = em.variable(f"k.lever_arm[{i}]", early=True)
        row = {STATES[j]: J[i][k] for k, j in enumerate(MOVED)}
        row["dtz"] = row["dtz"] + 2.0 * arm * dtz
        row[mount] = gravity
        row[force] = em.variable(f"k.c.accel_{'xy'[i]}_{force}", early=True)
        rows.append(row)
        expected.append(accel[i] + gravity * x[AT[mount]] + arm * (dtz * dtz))
    rows = [{AT.get(name, name): v for name, v in row.items()} for row in rows]
    residuals = [em.variable(f"y[{i}]") - e for i, e in enumerate(expected)]
    innovate(em, Covariance(em, "P", N), rows, residuals, sums, PRECISE)
    return em


def _restore() -> Emitter:
    em = Emitter("k.restore")
    restore(em, Covariance(em, "P", N), PRECISE)
    return em


@lru_cache(maxsize=1)
def made() -> Filter:
    constants = [
        "Real wheels[9];     // wheel angles from the ball's, rows",
        "Real lever_arm[2];  // x, y of the IMU",
        "Real g;",
        "Real keep;  // of the disturbance, per tick",
    ]
    steps = (ahead(_derivative, 10, 3), predict(), update(), _restore())
    return Filter("mbbr", STATES, 10, 3, 8, B, constants, *steps, PRECISE, INPUTS)
