"""The MIP (eduMIP) from first principles: a body on two wheels that neither slip nor slide sideways.

Conventions of [T] chapter 3: R_WB = Rz(psi) Rx(theta), axle along body x, phi the mean encoder angle (wheel
relative to body), psi' = (phi_1' - phi_2') r / d, u_1 = u_x + u_z, u_2 = u_x - u_z.

Kane's equations hold the side-slip constraint, psi-dependent as it is, exactly. [T] A.1, and the reference
vectors, put the constraint into the Lagrangian instead and so lose the side force's terms (lateral_terms).
The parameter `lateral` keeps both: 0 is the reference form, 1 the full one; see docs/derivation.md.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import sympy as sp

from .kane import Kane, first_order, solve_first_order

# [T] Table 3.2, SI. A wheel is round: I_w2 = I_w3. The IMU's default place is the centre of mass, (3.26).
TABLE_3_2 = {
    "m_b": 0.218,
    "m_w": 0.024,
    "r": 0.035,
    "d": 0.070,
    "l": 0.046,
    "I_b1": 5.91e-4,
    "I_b2": 2.99e-4,
    "I_b3": 2.91e-4,
    "I_w1": 6.42e-5,
    "I_w2": 7.48e-6,
    "I_r": 0.0,
    "k1": 0.12,
    "k2": 0.003,
    "g": 9.8,
    "l_ay": 0.0,
    "l_az": 0.046,
    "lateral": 0.0,
}
PARAMETERS = list(TABLE_3_2)
P = {name: sp.Symbol(name, positive=True) for name in PARAMETERS}
STATE = sp.symbols("th dth dph dps", real=True)
SPEED_DOTS = sp.symbols("ddth ddph ddps", real=True)
INPUT = sp.symbols("ux uz", real=True)
SMALL = STATE[:2]
TH, SPEEDS = STATE[0], STATE[1:]

LUMPED = {
    "A": P["I_b1"] + 2 * P["I_w1"] + P["m_b"] * (P["l"] + P["r"]) ** 2 + 2 * P["m_w"] * P["r"] ** 2,
    "B": 2 * P["I_w1"] + 2 * P["m_w"] * P["r"] ** 2 + P["m_b"] * P["r"] * (P["l"] + P["r"]),
    "W": 2 * P["I_w1"] + (P["m_b"] + 2 * P["m_w"]) * P["r"] ** 2,
    "V": 2 * P["I_w1"] + (P["m_b"] + 2 * P["m_w"]) * P["r"] ** 2 + 2 * P["I_r"],
    "Z": P["I_b3"] + 2 * P["I_w2"] + P["d"] ** 2 / 2 * ((P["I_w1"] + P["I_r"]) / P["r"] ** 2 + P["m_w"]),
    "C": P["I_b2"] - P["I_b3"] + P["m_b"] * P["l"] ** 2,
    "S": P["lateral"] * P["m_b"] * P["l"] * P["r"],
    "G": P["m_b"] * P["g"] * P["l"],
}


class _Motion:
    def __init__(self):
        dth, dph, dps = SPEEDS
        r = P["r"]
        rates = dict(zip(STATE, (dth, *SPEED_DOTS), strict=True))
        self.kane = Kane(SPEEDS, SPEED_DOTS, rates)
        self.R = sp.rot_axis1(-TH)  # yaw frame <- body
        self.omega_B = self.R.T * sp.Matrix([dth, 0, dps])
        self.yaw_rate = sp.Matrix([0, 0, dps])
        self.encoder_rates = [dph + sign * dps * P["d"] / (2 * r) for sign in (1, -1)]  # [T] (3.18)
        self.axle_velocity = sp.Matrix([0, -r * (dph + dth), 0])  # yaw frame, [T] (3.9)

    def velocity_B(self, position_B):
        """Of a point of the body, body axes."""
        return self.omega_B.cross(sp.Matrix(position_B)) + self.R.T * self.axle_velocity


def lateral_terms():
    """What the side force of the rolling constraint adds to the right-hand side of (theta, phi, psi)."""
    dth, dph, dps = SPEEDS
    force = P["m_b"] * P["l"] * P["r"] * sp.sin(TH) * dps
    return sp.Matrix([force * dps, force * dps, -force * (dph + dth)])


@lru_cache(maxsize=1)
def exact():
    """(mass, rhs) in (theta'', phi'', psi''); `lateral` chooses the form."""
    m = _Motion()
    kane = m.kane
    com = m.velocity_B((0, 0, P["l"]))
    kane.inertia(com, P["m_b"] * com, m.omega_B)
    kane.inertia(m.omega_B, sp.diag(P["I_b1"], P["I_b2"], P["I_b3"]) * m.omega_B, m.omega_B)
    kane.force(com, m.R.T * sp.Matrix([0, 0, -P["m_b"] * P["g"]]))
    wheel_inertia = sp.diag(P["I_w1"], P["I_w2"], P["I_w2"])
    for sign, encoder_rate in zip((1, -1), m.encoder_rates, strict=True):
        rate_B = m.omega_B + sp.Matrix([encoder_rate, 0, 0])
        velocity = m.axle_velocity + m.yaw_rate.cross(sp.Matrix([-sign * P["d"] / 2, 0, 0]))
        kane.inertia(rate_B, wheel_inertia * rate_B, m.omega_B)
        kane.inertia(velocity, P["m_w"] * velocity, m.yaw_rate)
        torque = P["k1"] * (INPUT[0] + sign * INPUT[1]) - P["k2"] * encoder_rate  # [T] (3.16)
        kane.force(sp.Matrix([encoder_rate]), sp.Matrix([torque]))
        # The rotor, reflected: it turns with the wheel against the body, so much faster than the body that
        # the body's own rate adds little (one part in the gear ratio).
        kane.inertia(sp.Matrix([encoder_rate]), sp.Matrix([P["I_r"] * encoder_rate]))
    mass, rhs = kane.equations()
    rhs -= (1 - P["lateral"]) * lateral_terms()
    return mass, rhs


def accelerometer_B():
    """[T] (3.26): gravity minus acceleration at the IMU (l_ay, l_az from the axle), body axes."""
    m = _Motion()
    velocity = m.velocity_B((0, P["l_ay"], P["l_az"]))
    return m.R.T * sp.Matrix([0, 0, -P["g"]]) - m.kane.derivative(velocity, m.omega_B)


@lru_cache(maxsize=1)
def _exact_functions():
    arguments = (STATE, INPUT, tuple(P.values()))
    equations = sp.lambdify(arguments, exact(), cse=True)
    return equations, sp.lambdify((*arguments, SPEED_DOTS), accelerometer_B(), cse=True)


def exact_accelerations(state, u, parameters=TABLE_3_2) -> np.ndarray:
    """(theta'', phi'', psi'') from (theta, theta', phi', psi') and (u_x, u_z)."""
    mass, rhs = _exact_functions()[0](state, u, [parameters[k] for k in PARAMETERS])
    return np.linalg.solve(mass, np.ravel(rhs))


def exact_accelerometer(state, u, accelerations, parameters=TABLE_3_2) -> np.ndarray:
    values = _exact_functions()[1](state, u, [parameters[k] for k in PARAMETERS], accelerations)
    return np.ravel(values)


def lump(expression):
    """Rewrites an expression of the parameters in LUMPED ones (r, d, l_ay, l_az, k1, k2, g stay)."""
    s = {name: sp.Symbol(name, positive=True) for name in LUMPED}
    p, reach = P, P["l"] + P["r"]
    in_order = [
        (p["I_b1"], s["A"] - 2 * p["I_w1"] - p["m_b"] * reach**2 - 2 * p["m_w"] * p["r"] ** 2),
        (p["I_b2"], s["C"] + p["I_b3"] - p["m_b"] * p["l"] ** 2),
        (
            p["I_b3"],
            s["Z"] - 2 * p["I_w2"] - p["d"] ** 2 / 2 * ((p["I_w1"] + p["I_r"]) / p["r"] ** 2 + p["m_w"]),
        ),
        (p["I_r"], (s["V"] - s["W"]) / 2),
        (p["lateral"], s["S"] / (p["m_b"] * p["l"] * p["r"])),
        (p["g"], s["G"] / (p["m_b"] * p["l"])),
        (p["m_b"], (s["B"] - s["W"]) / (p["l"] * p["r"])),
        (p["I_w1"], (s["W"] - (s["B"] - s["W"]) * p["r"] / p["l"] - 2 * p["m_w"] * p["r"] ** 2) / 2),
    ]
    for old, new in in_order:
        expression = expression.subs(old, new)
    return sp.expand(sp.cancel(expression))


@lru_cache(maxsize=1)
def high_yaw():
    """First order in theta and theta', [T] (3.19)-(3.27): ([theta'', phi'', psi''], [a_y])."""
    mass, rhs = exact()
    rows = [first_order(sp.expand(e), SMALL) for e in solve_first_order(mass, rhs, SMALL, lump)]
    y = first_order(accelerometer_B()[1], SMALL + SPEED_DOTS)
    y = y.subs(dict(zip(SPEED_DOTS, rows, strict=True)))
    return rows, [first_order(sp.expand(y), SMALL)]
