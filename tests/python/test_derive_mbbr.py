"""The derived MBBR model: exact form against reference vectors, small-angle form against known digits."""

import json
import math

import numpy as np
import pytest
import sympy as sp
from derive import kane, mbbr, mbbr_header


def digits(value: float, printed: float) -> bool:
    """value rounds to `printed` at printed's own number of significant digits (at least two)."""
    text = f"{abs(printed):g}".lstrip("0.").replace(".", "")
    count = max(2, len(text))
    return math.isclose(float(f"{value:.{count - 1}e}"), printed, rel_tol=1e-9)


@pytest.fixture(scope="module")
def coefficients():
    return mbbr_header.model().numbers(mbbr.TABLE_5_2)


def test_exact_dynamics_and_sensors_match_reference_vectors(root):
    rows = json.loads((root / "tests/data/oracle/mbbr_dynamics.json").read_text())["rows"]
    assert len(rows) == 200
    for row in rows:
        state = row["theta_xy"] + row["theta_dot"] + row["phi_star_dot"]
        accelerations = mbbr.exact_accelerations(state, row["tau_B"])
        gyro, encoder, accelerometer = mbbr.exact_sensors(state, row["tau_B"], accelerations)
        for ours, key in (
            (accelerations, "qdd"),
            (gyro, "gyro_B"),
            (encoder, "encoder_rate_B"),
            (accelerometer, "accel_B"),
        ):
            assert np.linalg.norm(ours - row[key]) <= 1e-9 * np.linalg.norm(row[key])


# Table 5.2 with mu_v added to k2; the rows of theta_x'', theta_z'' and the ball.
DIGITS = {
    "theta_x_ddot_tx": 129,
    "theta_x_ddot_dtx": -9.09,
    "theta_x_ddot_px": 9.09,
    "theta_x_ddot_ux": -133,
    "theta_x_ddot_dty_dtz": 1.80,
    "theta_x_ddot_tx_dtz2": 0.802,
    "theta_x_ddot_ty_uz": -309,
    "theta_x_ddot_ty_dtz": -12.1,
    "theta_z_ddot_dtz": -15.0,
    "theta_z_ddot_uz": -219,
    "theta_z_ddot_ty_px": 14.5,
    "theta_z_ddot_dty_px": 0.015,
    "theta_z_ddot_tx_py": -5.43,
    "theta_z_ddot_dtx_py": -0.015,
    "theta_z_ddot_ty_ux": 7.51,
    "theta_z_ddot_tx_uy": -140,
    "phi_x_ddot_tx": -277,
    "phi_x_ddot_dtx": 34.4,
    "phi_x_ddot_px": -34.4,
    "phi_x_ddot_ux": 502,
    "phi_x_ddot_ty_dtz": -6.63,
    "phi_x_ddot_dty_dtz": 0.441,
    "phi_x_ddot_tx_dtz2": 0.441,
    "phi_x_ddot_ty_uz": 405,
}


@pytest.mark.parametrize("name, printed", DIGITS.items())
def test_coefficients_have_the_known_digits(coefficients, name, printed):
    assert digits(coefficients[name], printed)


def test_y_row_mirrors_x_row(coefficients):
    mirror = {"tx": "ty", "ty": "tx", "dtx": "dty", "dty": "dtx", "px": "py", "py": "px", "ux": "uy"}
    for name, value in coefficients.items():
        for row in ("theta_x_ddot", "phi_x_ddot"):
            if name.startswith(row):
                terms = name[len(row) + 1 :].split("_")
                other = "_".join([row.replace("x", "y"), *[mirror.get(t.rstrip("2"), t) for t in terms]])
                found = [
                    v for k, v in coefficients.items() if sorted(k.split("_")) == sorted(other.split("_"))
                ]
                if "dtz2" in terms:
                    found = [coefficients[f"{row.replace('x', 'y')}_ty_dtz2"]]
                coupled = terms[-1] != "dtz2" and len(terms) == 2
                assert found == [pytest.approx(-value if coupled else value)], name


def test_momentum_about_the_contact_does_not_see_the_motors(coefficients):
    """Torque between body and ball is internal: 502, and not [T]'s 410, cancels (docs/derivation.md)."""
    p = mbbr.TABLE_5_2
    m11 = p["I_t1"] + p["I_w"] + p["m_t"] * p["l"] ** 2
    m14 = p["m_t"] * p["l"] * p["r"] - p["I_w"]
    m44 = p["I_b"] + p["I_w"] + (p["m_b"] + p["m_t"]) * p["r"] ** 2
    for term in ("ux", "px", "dtx"):
        theta, ball = coefficients[f"theta_x_ddot_{term}"], coefficients[f"phi_x_ddot_{term}"]
        assert (m11 + m14) * theta + (m14 + m44) * ball == pytest.approx(0, abs=1e-12)
    toppling = (m11 + m14) * coefficients["theta_x_ddot_tx"] + (m14 + m44) * coefficients["phi_x_ddot_tx"]
    assert toppling == pytest.approx(p["m_t"] * p["g"] * p["l"])


def test_accelerometer_rows_print_thesis_digits_with_the_lever_it_used():
    """[T] (5.29), (5.33) belong to l_az = 0.18 m, not to Table 5.2's 0.13 m."""
    c = mbbr_header.model().numbers(mbbr.TABLE_5_2 | {"l_az": 0.18})
    for name, printed in {
        "accel_x_ty": -4.6,
        "accel_x_uy": 7.8,
        "accel_x_tx_dtz": 0.32,
        "accel_x_dtx_dtz": -0.022,
        "accel_x_ty_dtz2": 0.022,
        "accel_x_tx_uz": -3.1,
        "accel_y_tx": 4.6,
        "accel_y_ux": -7.8,
        "accel_y_ty_dtz": 0.32,
        "accel_y_tx_dtz2": -0.022,
        "accel_y_ty_uz": -3.1,
    }.items():
        assert digits(c[name], printed), name
    assert c["accel_x_dty"] == pytest.approx(0.5, abs=0.05)


def test_small_angle_model_is_the_exact_models_tangent():
    """Halving the tilt quarters the difference: second order and nothing less."""
    rows, accelerometer = mbbr.high_yaw()
    values = list(mbbr.TABLE_5_2.values())
    lumped = {sp.Symbol(k, positive=True): e for k, e in mbbr.LUMPED.items()}
    model = sp.lambdify(
        (mbbr.STATE, mbbr.INPUT, tuple(mbbr.P.values())), [e.subs(lumped) for e in rows + accelerometer]
    )
    torque = sp.lambdify((mbbr.STATE, mbbr.INPUT, tuple(mbbr.P.values())), mbbr.drive_torque_B())
    tilt = np.array([0.8, -1.1, 3.0, 2.0])
    fast, u = [9.0, 4.0, -6.0], [0.7, -0.4, 1.1]

    def difference(scale):
        state = [*(scale * tilt), *fast]
        tau = np.ravel(torque(state, u, values))
        exact = mbbr.exact_accelerations(state, tau)
        inertial = exact - fast[0] * np.array([0, 0, 0, fast[2], -fast[1]])
        y = mbbr.exact_sensors(state, tau, exact)[2][:2]
        return np.array(model(state, u, values)) - np.concatenate([inertial, y])

    coarse, fine = difference(2e-3), difference(1e-3)
    assert np.all(np.abs(coarse) < 0.02)
    assert np.allclose(coarse, 4 * fine, rtol=0.05, atol=1e-7)


def test_wheel_terms_differ_from_lagranges_in_inertial_ball_angles():
    """0.0029, 0.994 and 0.012 belong to Lagrange's equations in inertial ball angles.

    They treat the spin-free constraint as holonomic. The difference is I_w (Omega x omega) in the ball's
    rows; Kane keeps it, and so do the reference vectors.
    """
    mass, rhs = mbbr.exact()
    m = mbbr.motion()
    ball = sp.Matrix([mbbr.SPEEDS[3], mbbr.SPEEDS[4], 0])
    rhs = rhs.copy()
    rhs[3:5, 0] -= mbbr.P["I_w"] * (m.R * m.omega_B).cross(ball)[:2, 0]
    torque = dict(zip(mbbr.TORQUE, mbbr.drive_torque_B(), strict=True))
    numbers = {mbbr.P[k]: v for k, v in mbbr.TABLE_5_2.items()}
    q = kane.solve_first_order(mass, rhs.subs(torque), mbbr.SMALL, lambda e: e.subs(numbers))
    tx, ty, _, _, dtz, px, py = mbbr.STATE

    def coefficient(i, monomial):
        return float(sp.expand(q[i]).coeff(monomial))

    assert digits(coefficient(0, dtz * py), 0.0029)
    assert digits(coefficient(3, dtz * py), 0.994)
    assert digits(coefficient(2, tx * dtz * px), 0.012)
    assert digits(coefficient(2, ty * dtz * py), 0.015)


def test_wheel_terms_of_kanes_form(coefficients):
    """By hand: seen from the turning body, a steady ball loads the wheels with I_w theta_z' phi'."""
    p = mbbr.TABLE_5_2
    A, B = p["I_t1"] + p["I_w"] + p["m_t"] * p["l"] ** 2, p["I_b"] + p["I_w"] + 0.7 * p["r"] ** 2
    C = p["m_t"] * p["l"] * p["r"] - p["I_w"]
    determinant = A * B - C**2
    assert coefficients["theta_x_ddot_dtz_py"] == pytest.approx(p["I_w"] * (B + C) / determinant)
    assert coefficients["phi_x_ddot_dtz_py"] == pytest.approx(-p["I_w"] * (A + C) / determinant)
    assert digits(coefficients["theta_x_ddot_dtz_py"], 0.00905)
    assert digits(1 + coefficients["phi_x_ddot_dtz_py"], 0.966)
