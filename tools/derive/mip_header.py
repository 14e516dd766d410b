"""config/generated/mip_model.hpp."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from . import emit, mip
from .model_header import Model, Rows

INPUTS = ("kane.py", "mip.py", "emit.py", "model_header.py", "mip_header.py")


@lru_cache(maxsize=1)
def model() -> Model:
    accelerations, accelerometer = mip.high_yaw()
    lumped = {name: sp.Symbol(name, positive=True) for name in mip.LUMPED}
    no_yaw = {mip.STATE[3]: 0, mip.INPUT[1]: 0}
    names = ["theta_ddot", "phi_ddot", "psi_ddot"]
    return Model(
        parameters=mip.PARAMETERS,
        state=mip.STATE,
        inputs=mip.INPUT,
        small=mip.SMALL,
        rows=[
            Rows(
                "accelerations",
                "a",
                names,
                accelerations,
                "a = (theta'', phi'', psi'') and J = da/dx; [T] (3.25).",
            ),
            Rows(
                "accelerometer",
                "y",
                ["accel_y"],
                accelerometer,
                "y = y of R^T(-g e3 - a) at the IMU, [T] (3.27) at (l_ay, l_az), and J = dy/dx.",
            ),
            Rows(
                "planar_accelerations",
                "a",
                names[:2],
                [e.subs(no_yaw) for e in accelerations[:2]],
                "Without yaw: x = (theta, theta', phi'), u = (u_x), a = (theta'', phi'').",
                state=mip.STATE[:3],
                inputs=mip.INPUT[:1],
            ),
            Rows(
                "planar_accelerometer",
                "y",
                ["accel_y"],
                [e.subs(no_yaw) for e in accelerometer],
                "Without yaw: y of R^T(-g e3 - a) at the IMU.",
                state=mip.STATE[:3],
                inputs=mip.INPUT[:1],
            ),
        ],
        lumped=mip.LUMPED,
        denominators={"D": lumped["A"] * lumped["V"] - lumped["B"] ** 2},
        parameter_comments={
            "m_b": "body",
            "m_w": "one wheel",
            "r": "wheel radius",
            "d": "distance between the wheels",
            "l": "axle to the body's centre of mass",
            "I_b1": "body about its centre of mass; 1: along the axle",
            "I_w1": "one wheel about its axle",
            "I_w2": "one wheel across its axle",
            "I_r": "rotor of one motor through its gear, about the wheel's angle against the body",
            "k1": "torque of one motor per unit of u",
            "k2": "back-EMF of one motor",
            "l_ay": "axle to the IMU",
            "lateral": "1: with the side force of rolling; 0: without, as [T] and the reference vectors",
        },
    )


def render() -> str:
    about = [
        "High-yaw-rate model of the MIP: theta and theta' to first order, all else arbitrary.",
        "x: theta, theta', phi' (encoder), psi'; u: u_x, u_z; SI, rad.",
        "Source: docs/derivation.md; [T] 3.2, A.1, corrected. RT-safe.",
    ]
    return emit.header(
        about,
        "mip_header.py",
        emit.input_hash(*INPUTS),
        "equipoise::generated::mip",
        model().body(),
    )
