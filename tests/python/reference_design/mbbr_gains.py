"""The scheduled controller of the MBBR: complex LQR over yaw rate, with the shipped weights."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from derive import mbbr

from . import lqr, mbbr_linear

TICK_S = 0.005  # [T] Table 5.2


@lru_cache(maxsize=1)
def weights() -> dict:
    text = (Path(__file__).resolve().parents[3] / "config" / "mbbr.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)["controller"]["scheduled"]["design"]


@dataclass(frozen=True)
class Row:
    yaw_rate: float  # rad/s
    gains: np.ndarray  # u = gains (x_hat - x_ref): theta, phi, body rate, phi*'
    margins: lqr.Margins


@dataclass(frozen=True)
class ReferenceTerms:
    """What a moving reference needs; the same at every yaw rate but for the wheels' turn."""

    speed: float  # u per rad/s of reference ball rate, against back-EMF and viscous friction
    speed_turn: float  # u per (rad/s)^2: -i speed_turn theta_z' phi_ref'
    lean: float  # theta_ref per rad/s^2 of inertial reference ball acceleration
    drive: float  # u per rad/s^2 of it


@dataclass(frozen=True)
class Design:
    rows: list[Row]
    yaw_gains: np.ndarray  # u_z = yaw_gains (x_hat - x_ref): theta_z, theta_z'
    yaw_feedforward: float
    yaw_margins: lqr.Margins


def tilt_and_ball_gains(yaw_rate: float, parameters=mbbr.TABLE_5_2):
    """(A, b, K) sampled, u = -K x."""
    w = weights()
    A, b = lqr.sampled(*mbbr_linear.complex_system(yaw_rate, parameters), TICK_S)
    deviations = [w["theta_rad"], w["phi_rad"], w["body_rate_rad_s"], w["phi_dot_rad_s"]]
    return A, b, lqr.lqr(A, b, [d**-2 for d in deviations], [w["u"] ** -2])


def yaw_gains(parameters=mbbr.TABLE_5_2):
    w = weights()
    J, Ju = mbbr_linear.real_jacobians(0.0, parameters)
    A, b = lqr.sampled(np.array([[0, 1], [0, J[2, 4]]]), np.array([[0], [Ju[2, 2]]]), TICK_S)
    return A, b, lqr.lqr(A, b, [w["theta_z_rad"] ** -2, w["theta_z_dot_rad_s"] ** -2], [w["u_z"] ** -2])


def reference_terms(parameters=mbbr.TABLE_5_2) -> ReferenceTerms:
    speed, lean, drive = mbbr_linear.feedforward(0.0, parameters)
    turning = mbbr_linear.feedforward(1.0, parameters)[0]
    return ReferenceTerms(speed.real, -(turning - speed).imag, lean.real, drive.real)


@lru_cache(maxsize=1)
def design() -> Design:
    table = weights()
    rows = []
    for hz in np.arange(0, table["last_hz"] + table["step_hz"] / 2, table["step_hz"]):
        yaw_rate = 2 * np.pi * hz
        A, b, K = tilt_and_ball_gains(yaw_rate)
        rows.append(Row(yaw_rate, -K[0], lqr.margins(A, b, K)))
    A, b, K = yaw_gains()
    return Design(rows, -K[0], mbbr_linear.yaw_feedforward(mbbr.TABLE_5_2), lqr.margins(A, b, K))
