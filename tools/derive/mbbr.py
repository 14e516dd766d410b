"""The MBBR from first principles: body on a ball that rolls without spinning, wheels between the two.

Conventions of docs/symbols.md: R_WB = Rz(theta_z) Ry(theta_y) Rx(theta_x), starred rates in the yaw frame.
The speeds are the Euler rates and phi*'; phi*' are quasi-speeds, so the ball's inertial acceleration,
resolved in the yaw frame, is phi*'' minus the transport term. [T] (5.32) and A.2 lack that term.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp

from .kane import Kane, first_order, solve_first_order

# [T] Table 5.2 and section 5.3, SI. I_w as printed is already the value about the ball (docs/derivation.md).
TABLE_5_2 = {
    "m_t": 0.550,
    "m_b": 0.150,
    "r": 0.032,
    "r_w": 0.0125,
    "l": 0.100,
    "l_az": 0.130,
    "I_t1": 2.42e-3,
    "I_t2": 2.42e-3,
    "I_t3": 0.79e-3,
    "I_b": 8.46e-5,
    "I_w": 1.20e-5,
    "k1": 0.176,
    "k2_ball": 0.011,
    "mu_v": 0.001056,
    "g": 9.8,
}
PARAMETERS = list(TABLE_5_2)
P = {name: sp.Symbol(name, positive=True) for name in PARAMETERS}
TILT = sp.symbols("tx ty", real=True)
SPEEDS = sp.symbols("dtx dty dtz px py", real=True)
SPEED_DOTS = sp.symbols("ddtx ddty ddtz dpx dpy", real=True)
TORQUE = sp.symbols("tau_x tau_y tau_z", real=True)
STATE = TILT + SPEEDS
INPUT = sp.symbols("ux uy uz", real=True)
SMALL = STATE[:4]

# Lumped parameters: the upright mass matrix is built of these, which keeps the coefficients readable.
LUMPED = {
    "A1": P["I_t1"] + P["I_w"] + P["m_t"] * P["l"] ** 2,  # body about the ball's centre, with the wheels
    "A2": P["I_t2"] + P["I_w"] + P["m_t"] * P["l"] ** 2,
    "A3": P["I_t3"] + P["I_w"],
    "B": P["I_b"]
    + P["I_w"]
    + (P["m_b"] + P["m_t"]) * P["r"] ** 2,  # ball about the contact, with all it carries
    "C": P["m_t"] * P["l"] * P["r"] - P["I_w"],  # coupling of tilt and ball
    "G": P["m_t"] * P["g"] * P["l"],  # gravity's toppling stiffness
    "k_d": P["k2_ball"] + P["mu_v"],  # back-EMF and viscous friction
}


def ball_velocity(rates):
    """Velocity of the ball's centre from its rates, yaw frame; [T] (5.9)."""
    return P["r"] * sp.Matrix([rates[1], -rates[0], 0])


@dataclass(frozen=True)
class Motion:
    """Kinematics: everything in the axes its name says."""

    R: sp.Matrix  # yaw frame <- body
    omega_B: sp.Matrix  # body rate
    yaw_rate: sp.Matrix  # rate of the yaw frame, yaw frame
    encoder_rate_B: sp.Matrix  # ball relative to body
    kane: Kane
    com_velocity_B: sp.Matrix


def motion() -> Motion:
    tx, ty = TILT
    dtx, dty, dtz, px, py = SPEEDS
    Ry, Rx = sp.rot_axis2(-ty), sp.rot_axis1(-tx)
    R = Ry * Rx
    omega_B = R.T * (
        Ry * sp.Matrix([dtx, 0, 0]) + sp.Matrix([0, dty, 0]) + sp.Matrix([0, 0, dtz])
    )  # [T] (5.7)
    rates = dict(zip(TILT, (dtx, dty), strict=True)) | dict(zip(SPEEDS, SPEED_DOTS, strict=True))
    ball_rate = sp.Matrix([px, py, 0])
    return Motion(
        R=R,
        omega_B=omega_B,
        yaw_rate=sp.Matrix([0, 0, dtz]),
        encoder_rate_B=R.T * ball_rate - omega_B,  # [T] (5.10)
        kane=Kane(SPEEDS, SPEED_DOTS, rates),
        com_velocity_B=omega_B.cross(sp.Matrix([0, 0, P["l"]])) + R.T * ball_velocity((px, py)),
    )


@lru_cache(maxsize=1)
def exact():
    """(mass, rhs) in the speeds' time derivatives; rhs for a total torque TORQUE on the ball, body axes."""
    m = motion()
    kane, ball_rate = m.kane, sp.Matrix([SPEEDS[3], SPEEDS[4], 0])
    velocity = ball_velocity((SPEEDS[3], SPEEDS[4]))
    inertia_B = sp.diag(P["I_t1"], P["I_t2"], P["I_t3"])
    kane.inertia(m.com_velocity_B, P["m_t"] * m.com_velocity_B, m.omega_B)
    kane.inertia(m.omega_B, inertia_B * m.omega_B, m.omega_B)
    kane.inertia(velocity, P["m_b"] * velocity, m.yaw_rate)
    kane.inertia(ball_rate, P["I_b"] * ball_rate, m.yaw_rate)
    # Each wheel turns about an axis fixed in the body: its spin's derivative has no frame term.
    kane.inertia(m.encoder_rate_B, P["I_w"] * m.encoder_rate_B)
    kane.force(m.encoder_rate_B, sp.Matrix(TORQUE))
    kane.force(m.com_velocity_B, m.R.T * sp.Matrix([0, 0, -P["m_t"] * P["g"]]))
    return kane.equations()


def accelerometer_B():
    """[T] (5.26): gravity minus acceleration at the IMU, body axes, in SPEED_DOTS."""
    m = motion()
    lever = sp.Matrix([0, 0, P["l_az"]])
    velocity = m.omega_B.cross(lever) + m.R.T * ball_velocity((SPEEDS[3], SPEEDS[4]))
    return m.R.T * sp.Matrix([0, 0, -P["g"]]) - m.kane.derivative(velocity, m.omega_B)


@lru_cache(maxsize=1)
def _exact_functions():
    mass, rhs = exact()
    arguments = (STATE, TORQUE, tuple(P.values()))
    m = motion()
    equations = sp.lambdify(arguments, (mass, rhs), cse=True)
    outputs = (m.omega_B, m.encoder_rate_B, accelerometer_B())
    return equations, sp.lambdify((*arguments, SPEED_DOTS), outputs, cse=True)


def exact_accelerations(state, torque_B, parameters=TABLE_5_2) -> np.ndarray:
    """d/dt of (theta_x', theta_y', theta_z', phi_x*', phi_y*')."""
    mass, rhs = _exact_functions()[0](state, torque_B, [parameters[k] for k in PARAMETERS])
    return np.linalg.solve(mass, np.ravel(rhs))


def exact_sensors(state, torque_B, accelerations, parameters=TABLE_5_2):
    """(gyro, encoder rate, accelerometer in [T]'s sign), body axes."""
    values = _exact_functions()[1](state, torque_B, [parameters[k] for k in PARAMETERS], accelerations)
    return tuple(np.ravel(v) for v in values)


def drive_torque_B():
    """Motors and viscous friction; [T] (5.13), (5.34) without Coulomb friction."""
    return P["k1"] * sp.Matrix(INPUT) - (P["k2_ball"] + P["mu_v"]) * motion().encoder_rate_B


def lump(expression):
    """Rewrites an expression of the parameters in LUMPED ones (I_w, r, l, l_az, k1, g stay)."""
    s = {name: sp.Symbol(name, positive=True) for name in LUMPED}
    I_w, r, length, g = P["I_w"], P["r"], P["l"], P["g"]
    m_t = (s["C"] + I_w) / (length * r)
    return sp.expand(
        expression.subs(
            {
                P["I_t1"]: s["A1"] - I_w - P["m_t"] * length**2,
                P["I_t2"]: s["A2"] - I_w - P["m_t"] * length**2,
                P["I_t3"]: s["A3"] - I_w,
                P["m_b"]: (s["B"] - P["I_b"] - I_w) / r**2 - P["m_t"],
                P["k2_ball"]: s["k_d"] - P["mu_v"],
                g: s["G"] / (P["m_t"] * length),
            }
        ).subs({P["m_t"]: m_t})
    )


@lru_cache(maxsize=1)
def high_yaw():
    """First order in tilt and its rates, [T] 5.1.6: (five accelerations, two accelerometer rows).

    Accelerations: theta_x'', theta_y'', theta_z'' and the ball's inertial ones resolved in the yaw frame.
    """
    mass, rhs = exact()
    torque = dict(zip(TORQUE, drive_torque_B(), strict=True))
    speed_dots = solve_first_order(mass, rhs.subs(torque), SMALL, lump)
    dtz, px, py = SPEEDS[2:]
    transport = sp.Matrix([0, 0, 0, dtz * py, -dtz * px])
    rows = [first_order(sp.expand(e), SMALL) for e in speed_dots - transport]
    y = [first_order(accelerometer_B()[i], SMALL + SPEED_DOTS[:2]) for i in (0, 1)]
    y = [e.subs(dict(zip(SPEED_DOTS, speed_dots, strict=True))) for e in y]
    return rows, [first_order(sp.expand(e), SMALL) for e in y]
