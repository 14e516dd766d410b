"""config/generated/mip_filter.*: one step of the MIP's default filter as straight-line code."""

from __future__ import annotations

from functools import lru_cache

from . import mip_header
from .filter_header import DT, Filter, ModelRows, add_noise, ahead
from .packed import Covariance, by_pairs, heun, innovate, restore
from .straight import Emitter

INPUTS = (*mip_header.INPUTS, "straight.py", "packed.py", "filter_header.py", "mip_filter.py")
# As in MipEkfModel.
STATES = ["th", "ph", "ps", "dth", "dph", "dps", "mx", "my", "mz", "bias", "arm", "scale", "ux", "uz"]
AT = {name: i for i, name in enumerate(STATES)}
N = len(STATES)
MOVED = [AT[s] for s in ("th", "dth", "dph", "dps")]
# Torque noise of a tick moves tilt and yaw rate by 0.13 rad/s, the gyro knows them to 0.001.
PRECISE = {
    0: (AT["dth"], [AT[s] for s in ("th", "dth", "bias", "dps", "mz", "my")]),
    2: (AT["dps"], [AT[s] for s in ("th", "dps", "dth", "mx", "my")]),
}
B = [(AT[s], i) for i, states in enumerate((("th", "ph", "dth", "dph"), ("ps", "dps"))) for s in states]


def _felt(em: Emitter, x):
    return [em.variable(f"u[{i}]") + x[AT["ux"] + i] for i in range(2)]


def _derivative(em: Emitter, u):
    rows = ModelRows(mip_header.model(), 0)

    def of(x, scale):
        a, J = rows.evaluate(em, [x[i] for i in MOVED], u, scale, ((0, 1),))
        A = {(i, 3 + i): em.constant(scale) for i in range(3)}
        A |= {(3 + i, j): J[i][k] for i in range(3) for k, j in enumerate(MOVED)}
        return [*(scale * v for v in x[3:]), *a], {ij: v for ij, v in A.items() if v.number != 0.0}

    return of


def predict() -> Emitter:
    em = Emitter("k.predict")
    x = [em.variable(f"x[{i}]") for i in range(N)]
    after, rows = heun(x[:6], _derivative(em, _felt(em, x)), DT)
    # The counted heading acts on nothing else, so that its step is the true one, scaled.
    ps, scale = AT["ps"], 1.0 + x[AT["scale"]]
    step = after[ps] - x[ps]
    after[ps] = x[ps] + scale * step
    del rows[ps][ps]
    rows[ps] = by_pairs([(scale, rows[ps])]) | {ps: em.constant(1.0), AT["scale"]: step}
    for place, (state, i) in enumerate(B):
        rows[state][AT["ux"] + i] = em.variable(f"k.B[{place}]", early=True)
    keep = em.variable("k.keep", early=True)
    felt = {AT[u]: keep * x[AT[u]] for u in ("ux", "uz")}
    P = Covariance(em, "P", N)
    P.transform({AT[s]: rows[AT[s]] for s in ("ph", "ps")})
    P.store()
    P.transform({i: rows[i] for i in MOVED})
    P.transform({i: {i: keep} for i in felt})
    add_noise(em, P, B)
    for i, value in {**dict(enumerate(after)), **felt}.items():
        em.store(f"x[{i}]", value)
    P.store()
    return em


def update() -> Emitter:
    em = Emitter("k.innovate")
    x = [em.variable(f"x[{i}]") for i in range(N)]
    th, ph, ps, dth, _, dps = x[:6]
    accel, J = ModelRows(mip_header.model(), 1).evaluate(em, [x[i] for i in MOVED], _felt(em, x))
    one = em.constant(1.0)
    bias, mount, lever, g, yaw_to_wheel, by_torque = (
        em.variable(f"k.{name}", early=True)
        for name in ("bias", "mount", "lever_arm", "g", "yaw_to_wheel", "c.accel_y_ux")
    )
    mx, my, mz = (mount * x[AT[m]] for m in ("mx", "my", "mz"))
    arm = lever * x[AT["arm"]]
    across = th * dps  # turning, the gyro's y axis sees theta psi'
    shortened = 1.0 - 0.5 * (mx * mx + my * my)
    squared = dps * dps
    rows = [
        # A sensor turned by delta sees omega - delta x omega, to second order of the large yaw rate only.
        {
            "th": mz * dps,
            "dth": one,
            "bias": bias,
            "dps": mz * th - my,
            "mz": mount * across,
            "my": -(mount * dps),
        },
        {"th": dps, "dth": -mz, "mz": -(mount * dth), "dps": th + mx, "mx": mount * dps},
        {
            "th": -(mx * dps),
            "dps": shortened - mx * th,
            "dth": my,
            "mx": -(mount * (across + mx * dps)),
            "my": mount * (dth - my * dps),
        },
        # Left, right; (3.18).
        {"ph": one, "ps": yaw_to_wheel},
        {"ph": one, "ps": -yaw_to_wheel},
        # Torque as felt, gravity through the mount, the centripetal acceleration of the lever arm.
        {
            **{STATES[j]: J[0][k] for k, j in enumerate(MOVED)},
            "dps": J[0][3] + 2.0 * (arm * dps),
            "mx": -(mount * g),
            "arm": lever * squared,
            "ux": by_torque,
        },
    ]
    expected = [
        dth + bias * x[AT["bias"]] - my * dps + mz * across,
        across + mx * dps - mz * dth,
        dps * shortened - mx * across + my * dth,
        ph + yaw_to_wheel * ps,
        ph - yaw_to_wheel * ps,
        accel[0] - g * mx + arm * squared,
    ]
    rows = [{AT[name]: v for name, v in row.items()} for row in rows]
    residuals = [em.variable(f"y[{i}]") - e for i, e in enumerate(expected)]
    innovate(em, Covariance(em, "P", N), rows, residuals, {}, PRECISE)
    return em


def _restore() -> Emitter:
    em = Emitter("k.restore")
    restore(em, Covariance(em, "P", N), PRECISE)
    return em


@lru_cache(maxsize=1)
def made() -> Filter:
    constants = [
        "Real yaw_to_wheel;",
        "Real bias;  // 1 where estimated, else 0",
        "Real mount;",
        "Real lever_arm;",
        "Real g;",
        "Real keep;  // of the disturbance, per tick",
    ]
    steps = (ahead(_derivative, 6, 2), predict(), update(), _restore())
    return Filter("mip", STATES, 6, 2, 6, B, constants, *steps, PRECISE, INPUTS)
