"""Tilt and translation of the MBBR at a constant yaw rate, as one complex system of four states.

z = theta_x + i theta_y, e = phi* error, w = body rate, v = phi*' error. With theta_z' = Omega and the u_z
that holds it, x' = A x + b u, u = u_x + i u_y. Angles seen in the yaw frame turn with it: e' = v - i Omega e.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import sympy as sp
from derive import mbbr


@lru_cache(maxsize=1)
def _jacobians():
    lumped = {sp.Symbol(k, positive=True): e for k, e in mbbr.LUMPED.items()}
    rows = sp.Matrix([e.subs(lumped) for e in mbbr.high_yaw()[0]])
    arguments = (mbbr.STATE, mbbr.INPUT, tuple(mbbr.P.values()))
    return sp.lambdify(arguments, (rows.jacobian(mbbr.STATE), rows.jacobian(mbbr.INPUT)))


def yaw_feedforward(parameters) -> float:
    """u_z per rad/s of yaw rate that holds it against back-EMF and viscous friction."""
    return -(parameters["k2_ball"] + parameters["mu_v"]) / parameters["k1"]


def real_jacobians(yaw_rate: float, parameters=mbbr.TABLE_5_2):
    """d(accelerations)/d(state), /d(input), upright and steady at `yaw_rate`."""
    state = [0, 0, 0, 0, yaw_rate, 0, 0]
    u = [0, 0, yaw_feedforward(parameters) * yaw_rate]
    J, Ju = _jacobians()(state, u, [parameters[k] for k in mbbr.PARAMETERS])
    return np.array(J, float), np.array(Ju, float)


def complex_system(yaw_rate: float, parameters=mbbr.TABLE_5_2):
    """(A, b), continuous time. The body must be symmetric: I_t1 = I_t2."""
    if parameters["I_t1"] != parameters["I_t2"]:
        raise ValueError(
            "I_t1 and I_t2 differ: the body is not symmetric and the complex form does not exist"
        )
    J, Ju = real_jacobians(yaw_rate, parameters)
    turn = 1j * yaw_rate
    tilt = J[0, [0, 2, 5]] + 1j * J[1, [0, 2, 5]]  # z'' from z, z', phi*'
    ball = J[3, [0, 2, 5]] + 1j * J[4, [0, 2, 5]]  # inertial, resolved in the yaw frame
    b = np.array([0, 0, Ju[0, 0] + 1j * Ju[1, 0], Ju[3, 0] + 1j * Ju[4, 0]]).reshape(4, 1)

    z_dot = np.array([-turn, 0, 1, 0])  # z' = w - i Omega z
    z_ddot = tilt[0] * np.eye(4)[0] + tilt[1] * z_dot + tilt[2] * np.eye(4)[3]
    ball_ddot = ball[0] * np.eye(4)[0] + ball[1] * z_dot + ball[2] * np.eye(4)[3]
    A = np.array(
        [
            z_dot,
            [0, -turn, 0, 1],
            z_ddot + turn * z_dot,
            ball_ddot - turn * np.eye(4)[3],  # transport of the turning frame
        ]
    )
    return A, b


def feedforward(yaw_rate: float, parameters=mbbr.TABLE_5_2):
    """Steady motion: u per rad/s of ball rate, and lean and u per rad/s^2 of inertial ball acceleration.

    Reference vectors that are constant in the inertial frame turn in the yaw frame; the lean turns with them,
    so the body rate is zero and only gravity, the motors and the acceleration remain.
    """
    A, b = complex_system(yaw_rate, parameters)
    speed = -A[2, 3] / b[2, 0]
    lean, drive = np.linalg.solve([[A[2, 0], b[2, 0]], [A[3, 0], b[3, 0]]], [0, 1])
    return speed, lean, drive
