"""The scheduled controller of the MBBR: complex LQR over yaw rate -> config/generated/mbbr_gains.hpp."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from . import emit, lqr, mbbr, mbbr_linear

INPUTS = ("kane.py", "mbbr.py", "emit.py", "lqr.py", "mbbr_linear.py", "mbbr_gains.py", "weights.toml")


@lru_cache(maxsize=1)
def weights() -> dict:
    return tomllib.loads((emit.HERE / "weights.toml").read_text(encoding="utf-8"))


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
    w = weights()["mbbr"]["tilt_and_ball"]
    A, b = lqr.sampled(*mbbr_linear.complex_system(yaw_rate, parameters), weights()["tick_s"])
    deviations = [w["theta_rad"], w["phi_rad"], w["body_rate_rad_s"], w["phi_dot_rad_s"]]
    return A, b, lqr.lqr(A, b, [d**-2 for d in deviations], [w["u"] ** -2])


def yaw_gains(parameters=mbbr.TABLE_5_2):
    w = weights()["mbbr"]["yaw"]
    J, Ju = mbbr_linear.real_jacobians(0.0, parameters)
    A, b = lqr.sampled(np.array([[0, 1], [0, J[2, 4]]]), np.array([[0], [Ju[2, 2]]]), weights()["tick_s"])
    return A, b, lqr.lqr(A, b, [w["theta_z_rad"] ** -2, w["theta_z_dot_rad_s"] ** -2], [w["u_z"] ** -2])


def reference_terms(parameters=mbbr.TABLE_5_2) -> ReferenceTerms:
    speed, lean, drive = mbbr_linear.feedforward(0.0, parameters)
    turning = mbbr_linear.feedforward(1.0, parameters)[0]
    return ReferenceTerms(speed.real, -(turning - speed).imag, lean.real, drive.real)


@lru_cache(maxsize=1)
def design() -> Design:
    table = weights()["mbbr"]["table"]
    rows = []
    for hz in np.arange(0, table["last_hz"] + table["step_hz"] / 2, table["step_hz"]):
        yaw_rate = 2 * np.pi * hz
        A, b, K = tilt_and_ball_gains(yaw_rate)
        rows.append(Row(yaw_rate, -K[0], lqr.margins(A, b, K)))
    A, b, K = yaw_gains()
    return Design(rows, -K[0], mbbr_linear.yaw_feedforward(mbbr.TABLE_5_2), lqr.margins(A, b, K))


def report() -> list[str]:
    lines = ["MBBR, scheduled: gains theta, phi, body rate, phi*' and margins of the tilt and ball loop"]
    for row in design().rows:
        gains = "  ".join(f"{g.real:.3g}{g.imag:+.3g}i" for g in row.gains)
        lines.append(f"  {row.yaw_rate / (2 * np.pi):4.2f} Hz  {gains}\n           {row.margins}")
    d = design()
    lines.append(f"  yaw      {d.yaw_gains[0]:.3g} {d.yaw_gains[1]:.3g}\n           {d.yaw_margins}")
    return lines


def number(value: float) -> str:
    text = f"{value + 0.0:.8g}"  # + 0.0: no negative zero
    return text if "." in text or "e" in text else text + ".0"


def _pair(value: complex) -> str:
    return f"{{{number(value.real)}, {number(value.imag if abs(value.imag) > 1e-12 else 0.0)}}}"


def render() -> str:
    d, r = design(), reference_terms()
    body = [
        "/// A complex gain: (re, im) acts on x + i y, so out_x = re x - im y and out_y = im x + re y.",
        "struct Complex {",
        "  double re;",
        "  double im;",
        "};",
        "",
        "struct Row {",
        "  double yaw_rate_rad_s;",
        "  Complex theta;",
        "  Complex phi;",
        "  Complex body_rate;",
        "  Complex phi_dot;",
        "};",
        "",
        "// u = theta d_theta + phi d_phi + body_rate d_body_rate + phi_dot d_phi_dot",
        "//     + (kSpeed - i kSpeedTurn theta_z') ref_phi_dot + kDrive ref_phi_ddot,",
        "// d = estimate - reference in the yaw frame; theta_ref = kLean ref_phi_ddot, body rate ref. 0.",
        "// ref_phi_ddot: inertial acceleration of the reference ball angles, resolved in the yaw frame.",
        f"inline constexpr std::size_t kRows = {len(d.rows)};",
        "/// Yaw rates >= 0; for negative ones take the complex conjugates.",
        "inline constexpr std::array<Row, kRows> kScheduled{{",
    ]
    for row in d.rows:
        body.append(f"    {{{number(row.yaw_rate)}, {', '.join(map(_pair, row.gains))}}},")
    body += [
        "}};",
        "",
        f"inline constexpr double kSpeed = {number(r.speed)};  // (k2_ball + mu_v) / k1",
        f"inline constexpr double kSpeedTurn = {number(r.speed_turn)};  // I_w / k1",
        f"inline constexpr double kLean = {number(r.lean)};  // (B + C) / G of docs/derivation.md",
        f"inline constexpr double kDrive = {number(r.drive)};  // B / k1",
        "",
        "/// u_z = kYawAngle d_theta_z + kYawRate d_theta_z_dot + kYawFeedforward ref_theta_z_dot.",
        f"inline constexpr double kYawAngle = {number(d.yaw_gains[0])};",
        f"inline constexpr double kYawRate = {number(d.yaw_gains[1])};",
        f"inline constexpr double kYawFeedforward = {number(d.yaw_feedforward)};",
        "",
    ]
    about = [
        "Scheduled controller of the MBBR: complex LQR gains over yaw rate, yaw gains, steady feed-forward.",
        "In: errors in the yaw frame -> out: u about the body axes, before friction compensation.",
        "Design and weights: tools/derive/mbbr_gains.py, weights.toml; docs/derivation.md. 200 Hz. RT-safe.",
    ]
    extra = repr(sorted(mbbr.TABLE_5_2.items()))
    return emit.header(
        about,
        "mbbr_gains.py",
        emit.input_hash(*INPUTS, extra=extra),
        "equipoise::generated::mbbr",
        body,
        includes=("array", "cstddef"),
    )
