"""The MIP's controllers at 200 Hz, successive loop closure and LQR, with the shipped weights."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from derive import mip, mip_header
from scipy import signal

from . import lqr

TICK_S = 0.005
YAW_RATES = (0.0, 5.0, 10.0)  # rad/s: the dissertation's experiments, [T] Table 3.3


@dataclass(frozen=True)
class Slc:
    """u = D1 (theta_ref - theta), theta_ref = D2 (phi_ref - phi), u_z = Dz; [T] (3.50)-(3.52)."""

    rate_hz: float
    D1: tuple  # (numerator, denominator) in descending powers of z
    D2: tuple
    yaw: tuple  # per psi error, per psi' error


# The coefficients the robot's own library was published with, for 100 Hz. [T] (3.50)-(3.51) print them with
# three digits and D2's sign reversed, and are unstable so (docs/derivation.md).
PUBLISHED = Slc(
    100.0,
    ((-4.945, 8.862, -3.967), (1.0, -1.481, 0.4812)),
    ((0.18856, -0.37209, 0.18354), (1.0, -1.86046, 0.86046)),
    (1.0, 0.05),
)
AS_PRINTED = Slc(
    200.0,
    ((-4.95, 8.86, -3.97), (1.0, -1.48, 0.481)),
    ((-0.189, 0.372, -0.184), (1.0, -1.86, 0.86)),
    (1.0, 0.05),
)


@lru_cache(maxsize=1)
def config() -> dict:
    text = (Path(__file__).resolve().parents[3] / "config" / "edumip.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def parameters() -> dict:
    """[T] Table 3.2 with the configured viscous friction, which acts as back-EMF does."""
    return mip.TABLE_3_2 | {"k2": mip.TABLE_3_2["k2"] + config()["robot"]["viscous_friction_N_m_s"]}


@lru_cache(maxsize=4)
def _coefficients(lateral: float = 1.0) -> dict:
    return mip_header.model().numbers(parameters() | {"lateral": lateral})


def planar_system(yaw_rate: float = 0.0, lateral: float = 1.0):
    """(A, b) of (theta, phi, theta', phi') and u_x, about upright at a constant yaw rate."""
    c = _coefficients(lateral)
    A, b = np.zeros((4, 4)), np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    for i, row in enumerate(("theta_ddot", "phi_ddot")):
        A[2 + i, 0] = c[f"{row}_th"] + c[f"{row}_th_dps2"] * yaw_rate**2
        A[2 + i, 3] = c[f"{row}_dph"]
        b[2 + i, 0] = c[f"{row}_ux"]
    return A, b


def yaw_system():
    """(A, b) of (psi, psi') and u_z."""
    c = _coefficients()
    return np.array([[0.0, 1.0], [0.0, c["psi_ddot_dps"]]]), np.array([[0.0], [c["psi_ddot_uz"]]])


def slc_loop(slc: Slc, A, b):
    """Plant and controller as one loop, broken at u: (A, b, K), u = -K x."""
    A1, B1, C1, d1 = signal.tf2ss(*slc.D1)
    A2, B2, C2, d2 = signal.tf2ss(*slc.D2)
    n = len(A)
    theta, phi = np.eye(1, n + 4, 0), np.eye(1, n + 4, 1)
    in_1, in_2 = slice(n, n + 2), slice(n + 2, n + 4)
    theta_ref = -d2 * phi
    theta_ref[:, in_2] += C2
    error = theta_ref - theta
    u = d1 * error
    u[:, in_1] += C1
    whole = np.zeros((n + 4, n + 4))
    whole[:n, :n] = A
    whole[in_1] = B1 @ error
    whole[in_1, in_1] += A1
    whole[in_2] = -B2 @ phi
    whole[in_2, in_2] += A2
    return whole, np.vstack([b, np.zeros((4, 1))]), -u


def slc_pole(slc: Slc, rate_hz: float) -> float:
    """Largest closed-loop pole of the same coefficients run at some rate."""
    return lqr.largest_pole(*slc_loop(slc, *lqr.sampled(*planar_system(), 1 / rate_hz)))


@lru_cache(maxsize=1)
def slc_design() -> Slc:
    """Corner frequencies relative to the robot's poles, discretised by Tustin's rule."""
    w = config()["controller"]["slc"]["design"]
    A, b = planar_system()
    keep = [0, 2, 3]  # phi is an integrator
    poles = np.linalg.eigvals(A[np.ix_(keep, keep)]).real
    unstable, fastest = max(poles), -min(poles)
    hold = abs(A[2, 0] / b[2, 0])
    wheel_per_lean = abs(A[3, 0] + b[3, 0] * hold)
    lead, pole = w["lead_q"] * fastest, w["outer_pole_p"] * unstable
    D1 = (
        -w["gain_U"] * hold * np.polymul([1, w["integral_p"] * unstable], [1 / lead, 1]),
        np.polymul([1, 0], [1 / w["roll_off_rad_s"], 1]),
    )
    D2 = (
        w["outer_gain_pp_a"]
        * unstable**2
        / wheel_per_lean
        * np.array([1 / (w["outer_zero_p"] * unstable), 1]),
        np.polymul([1 / pole, 1], [1 / w["outer_roll_off_rad_s"], 1]),
    )
    discrete = [signal.cont2discrete(d, TICK_S, method="bilinear")[:2] for d in (D1, D2)]
    return Slc(1 / TICK_S, *[(tuple(np.ravel(n)), tuple(np.ravel(d))) for n, d in discrete], yaw_gains())


def lqr_gains() -> np.ndarray:
    """u_x = gains (reference - estimate) of theta, phi, theta', phi'."""
    w = config()["controller"]["lqr"]["design"]
    A, b = lqr.sampled(*planar_system(), TICK_S)
    deviations = [w["theta_rad"], w["phi_rad"], w["theta_dot_rad_s"], w["phi_dot_rad_s"]]
    return lqr.lqr(A, b, [d**-2 for d in deviations], [w["u_x"] ** -2])[0]


def yaw_gains() -> tuple:
    w = config()["controller"]["yaw"]
    A, b = lqr.sampled(*yaw_system(), TICK_S)
    return tuple(lqr.lqr(A, b, [w["psi_rad"] ** -2, w["psi_dot_rad_s"] ** -2], [w["u_z"] ** -2])[0])


def margins(controller: str, yaw_rate: float, lateral: float = 1.0, late_ticks: int = 1) -> lqr.Margins:
    """At u, with the input already `late_ticks` late; controller: slc, published, lqr."""
    rate = PUBLISHED.rate_hz if controller == "published" else 1 / TICK_S
    A, b = lqr.sampled(*planar_system(yaw_rate, lateral), 1 / rate)
    if controller == "lqr":
        loop = (A, b, lqr_gains().reshape(1, 4))
    else:
        loop = slc_loop(PUBLISHED if controller == "published" else slc_design(), A, b)
    return lqr.margins(*lqr.delayed(*loop, late_ticks))


def speed_feedforward() -> float:
    """u_x per rad/s of phi' against back-EMF."""
    return parameters()["k2"] / parameters()["k1"]


def yaw_feedforward() -> float:
    """u_z per rad/s of psi' against back-EMF."""
    A, b = yaw_system()
    return float(-A[1, 1] / b[1, 0])
