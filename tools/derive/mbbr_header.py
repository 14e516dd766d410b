"""config/generated/mbbr_model.hpp."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from . import emit, mbbr
from .model_header import Model, Rows

INPUTS = ("kane.py", "mbbr.py", "emit.py", "model_header.py", "mbbr_header.py")
_S = {name: sp.Symbol(name, positive=True) for name in mbbr.LUMPED}


@lru_cache(maxsize=1)
def model() -> Model:
    accelerations, accelerometer = mbbr.high_yaw()
    ball = ["theta_x_ddot", "theta_y_ddot", "theta_z_ddot", "phi_x_ddot", "phi_y_ddot"]
    return Model(
        parameters=mbbr.PARAMETERS,
        state=mbbr.STATE,
        inputs=mbbr.INPUT,
        small=mbbr.SMALL,
        rows=[
            Rows(
                "accelerations",
                "a",
                ball,
                accelerations,
                "a = (theta_x'', theta_y'', theta_z'', ball x, ball y: inertial) and J = da/dx.",
            ),
            Rows(
                "accelerometer",
                "y",
                ["accel_x", "accel_y"],
                accelerometer,
                "y = x and y of R^T(-g e3 - a) at the IMU, [T] (5.26), and J = dy/dx.",
            ),
        ],
        lumped=mbbr.LUMPED,
        denominators={
            "D1": _S["A1"] * _S["B"] - _S["C"] ** 2,
            "D2": _S["A2"] * _S["B"] - _S["C"] ** 2,
        },
        parameter_comments={
            "m_t": "top body",
            "m_b": "ball",
            "r": "ball radius",
            "r_w": "omniwheel radius",
            "l": "ball centre to the body's centre of mass",
            "l_az": "ball centre to the IMU",
            "I_t1": "body about its centre of mass",
            "I_b": "ball about its centre",
            "I_w": "wheels, as seen about the ball",
            "k1": "torque about the ball per unit of u",
            "k2_ball": "back-EMF about the ball, k2 (r / r_w)^2",
            "mu_v": "viscous friction about the ball",
        },
    )


def render() -> str:
    about = [
        "High-yaw-rate model of the MBBR: tilt and its rates to first order, all else arbitrary.",
        "x: theta_x, theta_y, theta_x', theta_y', theta_z', phi_x*', phi_y*'; u: u_x, u_y, u_z; SI, rad.",
        "The ball's accelerations a[3], a[4] are inertial, resolved in the yaw frame:",
        "d/dt phi_x*' = a[3] + theta_z' phi_y*', d/dt phi_y*' = a[4] - theta_z' phi_x*'.",
        "Source: docs/derivation.md; [T] 5.1.6, corrected. RT-safe.",
    ]
    return emit.header(
        about,
        "mbbr_header.py",
        emit.input_hash(*INPUTS),
        "equipoise::generated::mbbr",
        model().body(),
    )
