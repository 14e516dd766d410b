"""The derived MIP model: reference vectors, known digits, and what the side force of rolling changes."""

import json

import numpy as np
import pytest
import sympy as sp
from derive import mip, mip_header

DT = 0.005
FULL = mip.TABLE_3_2 | {"lateral": 1.0}


@pytest.fixture(scope="module")
def coefficients():
    return mip_header.model().numbers(mip.TABLE_3_2)


def test_exact_dynamics_and_accelerometer_match_reference_vectors(root):
    rows = json.loads((root / "tests/data/oracle/mip_dynamics.json").read_text())["rows"]
    assert len(rows) == 200
    for row in rows:
        state = [row["theta"], row["theta_dot"], row["phi_dot"], row["psi_dot"]]
        u = [row["u_x"], row["u_z"]]
        accelerations = mip.exact_accelerations(state, u)
        accelerometer = mip.exact_accelerometer(state, u, accelerations)
        for ours, key in ((accelerations, "qdd"), (accelerometer, "accel_B")):
            assert np.linalg.norm(ours - row[key]) <= 1e-9 * np.linalg.norm(row[key])


@pytest.mark.parametrize(
    "name, per_tick, printed, decimals",
    [
        ("theta_ddot_th", True, 0.629, 3),
        ("theta_ddot_dph", True, 0.0681, 4),
        ("theta_ddot_th_dps2", True, 0.00300, 5),
        ("theta_ddot_ux", True, -2.72, 2),
        ("phi_ddot_th", True, -1.115, 3),
        ("phi_ddot_th_dps2", True, -0.00533, 5),
        ("phi_ddot_ux", True, 7.47, 2),
        ("psi_ddot_uz", True, 2.43, 2),
        ("accel_y_th_dps2", False, -0.0346, 4),
        ("accel_y_th", False, -7.41, 2),
        ("accel_y_dph", False, -0.204, 3),
        ("accel_y_ux", False, 8.17, 2),
    ],
)
def test_coefficients_have_the_known_digits(coefficients, name, per_tick, printed, decimals):
    """Known digits are those of one explicit Euler tick, [T] (3.41)-(3.43) corrected."""
    value = coefficients[name] * (DT if per_tick else 1.0)
    assert round(value, decimals) == pytest.approx(printed)


def test_rates_decay_as_known(coefficients):
    assert round(1 + DT * coefficients["phi_ddot_dph"], 3) == 0.813
    assert round(1 + DT * coefficients["psi_ddot_dps"], 3) == 0.939


def test_small_angle_model_is_the_exact_models_tangent():
    """Halving theta quarters the difference, for either form and for an IMU off the centre of mass."""
    parameters = FULL | {"l_ay": 0.01, "l_az": 0.03}
    values = list(parameters.values())
    lumped = {sp.Symbol(k, positive=True): e for k, e in mip.LUMPED.items()}
    rows, accelerometer = mip.high_yaw()
    model = sp.lambdify(
        (mip.STATE, mip.INPUT, tuple(mip.P.values())), [e.subs(lumped) for e in rows + accelerometer]
    )
    u = [0.3, -0.2]

    def difference(scale):
        state = [0.9 * scale, -4.0 * scale, 6.0, 8.0]
        exact = mip.exact_accelerations(state, u, parameters)
        y = mip.exact_accelerometer(state, u, exact, parameters)[1]
        return np.array(model(state, u, values)) - np.array([*exact, y])

    coarse, fine = difference(4e-3), difference(2e-3)
    assert np.all(np.abs(coarse) < 0.05)
    assert np.all(np.abs(fine) <= 0.3 * np.abs(coarse) + 1e-9)


def test_lever_arm_turns_yaw_rate_into_a_bias(coefficients):
    """l_ay psi'^2: the centripetal reading that [T] saw at 10 rad/s and attributed to the IMU's place."""
    c = mip_header.model().numbers(mip.TABLE_3_2 | {"l_ay": 0.01})
    assert c["accel_y_dps2"] == pytest.approx(0.01)
    assert coefficients["accel_y_dps2"] == 0


def lagrange():
    """[T] (3.12)-(3.18): the constraint put into the Lagrangian of theta, phi, psi."""
    p = mip.P
    th, (dth, dph, dps) = mip.TH, mip.SPEEDS
    v = p["r"] * (dph + dth)  # towards -y of the yaw frame
    com = sp.Matrix([dps * p["l"] * sp.sin(th), -v - p["l"] * sp.cos(th) * dth, -p["l"] * sp.sin(th) * dth])
    energy = p["m_b"] * com.dot(com) / 2
    rate = (dth, sp.sin(th) * dps, sp.cos(th) * dps)
    energy += sum(p[i] * w**2 for i, w in zip(("I_b1", "I_b2", "I_b3"), rate, strict=True)) / 2
    for sign in (1, -1):
        encoder = dph + sign * p["d"] * dps / (2 * p["r"])
        energy += p["m_w"] * (p["r"] * (encoder + dth)) ** 2 / 2
        energy += (p["I_w1"] * (encoder + dth) ** 2 + p["I_w2"] * dps**2) / 2
        energy += p["I_r"] * encoder**2 / 2
    L = energy - p["m_b"] * p["g"] * p["l"] * sp.cos(th)
    momentum = sp.Matrix([sp.diff(L, s) for s in mip.SPEEDS])
    mass = momentum.jacobian(mip.SPEEDS)
    ux, uz = mip.INPUT
    force = sp.Matrix(
        [
            0,
            2 * (p["k1"] * ux - p["k2"] * dph),
            p["d"] / p["r"] * (p["k1"] * uz - p["k2"] * p["d"] * dps / (2 * p["r"])),
        ]
    )
    return mass, force + sp.Matrix([sp.diff(L, th), 0, 0]) - momentum.diff(th) * dth


def test_reference_form_is_lagranges_with_the_constraint_put_in():
    """Without lateral_terms Kane's equations are exactly those; with them they are not."""
    mass, rhs = mip.exact()
    mass_L, rhs_L = lagrange()
    assert (mass - mass_L).applyfunc(sp.simplify) == sp.zeros(3)
    difference = (rhs - rhs_L).applyfunc(sp.simplify)
    expected = mip.P["lateral"] * mip.lateral_terms()
    assert (difference - expected).applyfunc(sp.simplify) == sp.zeros(3, 1)


def multipliers(state, u):
    """Accelerations from the unconstrained robot (x, y, psi, theta, phi) with multipliers for rolling."""
    p = {k: sp.Float(v) for k, v in FULL.items()}
    t = sp.Symbol("t")
    q = [sp.Function(n)(t) for n in ("x", "y", "psi", "theta", "phi")]
    x, y, psi, th, ph = q
    turn = sp.Matrix([[sp.cos(psi), -sp.sin(psi), 0], [sp.sin(psi), sp.cos(psi), 0], [0, 0, 1]])
    axle = sp.Matrix([x, y, 0])
    com = axle + turn * sp.Matrix([0, -p["l"] * sp.sin(th), p["l"] * sp.cos(th)])
    energy = p["m_b"] * com.diff(t).dot(com.diff(t)) / 2
    rate = (th.diff(t), sp.sin(th) * psi.diff(t), sp.cos(th) * psi.diff(t))
    energy += sum(p[i] * w**2 for i, w in zip(("I_b1", "I_b2", "I_b3"), rate, strict=True)) / 2
    for sign in (1, -1):
        wheel = axle + turn * sp.Matrix([-sign * p["d"] / 2, 0, 0])
        spin = ph.diff(t) + sign * p["d"] * psi.diff(t) / (2 * p["r"]) + th.diff(t)
        energy += p["m_w"] * wheel.diff(t).dot(wheel.diff(t)) / 2
        energy += (p["I_w1"] * spin**2 + p["I_w2"] * psi.diff(t) ** 2) / 2
    L = energy - p["m_b"] * p["g"] * com[2]
    rates = [c.diff(t) for c in q]
    force = [
        0,
        0,
        p["d"] / p["r"] * (p["k1"] * u[1] - p["k2"] * p["d"] * rates[2] / (2 * p["r"])),
        0,
        2 * (p["k1"] * u[0] - p["k2"] * rates[4]),
    ]
    equations = [L.diff(v).diff(t) - L.diff(c) - f for c, v, f in zip(q, rates, force, strict=True)]
    forward = -sp.sin(psi) * rates[0] + sp.cos(psi) * rates[1] + p["r"] * (rates[3] + rates[4])
    sideways = sp.cos(psi) * rates[0] + sp.sin(psi) * rates[1]
    constraint = sp.Matrix([forward, sideways])
    A = constraint.jacobian(rates)
    multiplier = sp.symbols("m0 m1")
    second = [sp.Symbol(f"a{i}") for i in range(5)]
    theta, dtheta, dphi, dpsi = state
    at = dict(zip(q, (0, 0, 0.4, theta, 0), strict=True))
    v = -FULL["r"] * (dtheta + dphi)
    values = (-v * np.sin(0.4), v * np.cos(0.4), dpsi, dtheta, dphi)
    system = [e - f for e, f in zip(equations, A.T * sp.Matrix(multiplier), strict=True)]
    system += list(constraint.diff(t))
    for derivatives in (
        {c.diff(t, 2): s for c, s in zip(q, second, strict=True)},
        dict(zip(rates, values, strict=True)),
        at,
    ):
        system = [sp.sympify(e).subs(derivatives) for e in system]
    unknowns = [*second, *multiplier]
    matrix, right = sp.linear_eq_to_matrix(system, unknowns)
    a = np.linalg.solve(np.array(matrix, float), np.array(right, float))[:, 0]
    return a[[3, 4, 2]]


def test_full_form_agrees_with_multipliers():
    """An independent route, with side-slip forbidden by a force: the full form is right, the other is not."""
    state, u = [0.25, -0.8, 5.0, 9.0], [0.2, -0.1]
    truth = multipliers(state, u)
    assert mip.exact_accelerations(state, u, FULL) == pytest.approx(truth, rel=1e-10)
    reference = mip.exact_accelerations(state, u)
    assert np.linalg.norm(reference - truth) > 0.05 * np.linalg.norm(truth)


def test_lateral_terms_do_no_work():
    assert sp.simplify(mip.lateral_terms().dot(sp.Matrix(mip.SPEEDS))) == 0


def test_the_rotor_turns_with_the_wheel_against_the_body():
    """Standing upright at rest, by Newton: the rotors add to the torques' own equation, not to the body's."""
    p = FULL | {"I_r": 5e-5}
    total = p["m_b"] * p["r"] ** 2 + 2 * p["m_w"] * p["r"] ** 2 + 2 * p["I_w1"]
    coupled = total + p["m_b"] * p["r"] * p["l"]
    body = coupled + p["m_b"] * p["l"] * (p["l"] + p["r"]) + p["I_b1"]
    expected = np.linalg.solve([[body, coupled], [coupled, total + 2 * p["I_r"]]], [0.0, 2 * p["k1"] * 0.1])
    accelerations = mip.exact_accelerations([0, 0, 0, 0], [0.1, 0.05], p)
    np.testing.assert_allclose(accelerations[:2], expected, rtol=1e-9)
    about_z = p["I_b3"] + 2 * p["I_w2"] + p["d"] ** 2 / 2 * ((p["I_w1"] + p["I_r"]) / p["r"] ** 2 + p["m_w"])
    assert accelerations[2] == pytest.approx(p["d"] / p["r"] * p["k1"] * 0.05 / about_z)
    coefficients = mip_header.model().numbers(p)
    assert coefficients["theta_ddot_ux"] * 0.1 == pytest.approx(expected[0])
    assert coefficients["phi_ddot_ux"] * 0.1 == pytest.approx(expected[1])
