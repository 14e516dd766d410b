"""The scheduled gains: the complex model beneath, their margins, and the exact robot holding."""

import itertools

import numpy as np
import pytest
from derive import mbbr
from reference_design import lqr, mbbr_gains, mbbr_linear
from reference_design.mbbr_simulation import Scenario, simulate

HZ = 2 * np.pi


@pytest.mark.parametrize("yaw_hz", [0.0, 1.0, -3.0])
def test_complex_model_has_the_exact_models_modes(yaw_hz):
    """Linearised at a steady spin, the exact equations have the complex model's poles and conjugates."""
    yaw_rate = HZ * yaw_hz
    p = mbbr.TABLE_5_2
    k_d = p["k2_ball"] + p["mu_v"]
    u = np.array([0, 0, mbbr_linear.yaw_feedforward(p) * yaw_rate])

    def derivative(y):
        state = [y[0], y[1], y[2], y[3], yaw_rate, y[4], y[5]]
        rate = mbbr.exact_sensors(state, np.zeros(3), np.zeros(5))[1]
        a = mbbr.exact_accelerations(state, p["k1"] * u - k_d * rate)
        return np.array([y[2], y[3], a[0], a[1], a[3], a[4]])

    h = 1e-5
    J = np.array([(derivative(h * e) - derivative(-h * e)) / (2 * h) for e in np.eye(6)]).T
    A, _ = mbbr_linear.complex_system(yaw_rate)
    keep = [0, 2, 3]
    poles = np.linalg.eigvals(A[np.ix_(keep, keep)])
    expected = np.concatenate([poles, poles.conj()])
    for pole in np.linalg.eigvals(J):
        assert np.min(np.abs(expected - pole)) < 1e-4


def test_asymmetric_body_has_no_complex_form():
    with pytest.raises(ValueError, match="symmetric"):
        mbbr_linear.complex_system(1.0, mbbr.TABLE_5_2 | {"I_t2": 2.5e-3})


def test_back_emf_feedforward():
    """-(15/219): the yaw torque that holds a spin; the same ratio holds a ball rate."""
    assert mbbr_linear.yaw_feedforward(mbbr.TABLE_5_2) == pytest.approx(-15.0 / 219.0, rel=2e-3)
    terms = mbbr_gains.reference_terms()
    assert terms.speed == pytest.approx(-mbbr_linear.yaw_feedforward(mbbr.TABLE_5_2))
    assert terms.speed_turn == pytest.approx(mbbr.TABLE_5_2["I_w"] / mbbr.TABLE_5_2["k1"])


@pytest.mark.parametrize("yaw_hz", [0.0, 2.0])
def test_reference_terms_hold_at_every_yaw_rate(yaw_hz):
    speed, lean, drive = mbbr_linear.feedforward(HZ * yaw_hz)
    terms = mbbr_gains.reference_terms()
    assert speed == pytest.approx(terms.speed - 1j * terms.speed_turn * HZ * yaw_hz)
    assert lean == pytest.approx(terms.lean)
    assert drive == pytest.approx(terms.drive)


def test_lean_is_the_one_a_uniform_acceleration_needs():
    """Balance of moments about the moving ball's contact: (B + C) phi'' = G theta."""
    p = mbbr.TABLE_5_2
    B = p["I_b"] + p["I_w"] + (p["m_b"] + p["m_t"]) * p["r"] ** 2
    C = p["m_t"] * p["l"] * p["r"] - p["I_w"]
    assert mbbr_gains.reference_terms().lean == pytest.approx((B + C) / (p["m_t"] * p["g"] * p["l"]))


def test_cross_terms_grow_with_yaw_rate():
    """At rest the tilt's gain is real."""
    at = {round(row.yaw_rate / HZ, 2): row.gains[0] for row in mbbr_gains.design().rows}
    assert abs(at[0.0].imag) < 1e-9
    assert 15 < at[3.0].real < 30
    cross = [abs(row.gains[0].imag) for row in mbbr_gains.design().rows]
    assert cross == sorted(cross)


def test_negative_yaw_rates_take_the_conjugate_gains():
    K = mbbr_gains.tilt_and_ball_gains(HZ * 2)[2]
    mirrored = mbbr_gains.tilt_and_ball_gains(-HZ * 2)[2]
    assert np.allclose(mirrored, K.conj(), rtol=1e-6)


def test_margins_between_and_at_the_rows():
    rows = mbbr_gains.design().rows
    assert rows[0].yaw_rate == 0
    assert rows[-1].yaw_rate == pytest.approx(HZ * 3.5)
    for low, high in itertools.pairwise(rows):
        middle = (low.yaw_rate + high.yaw_rate) / 2
        A, b, _ = mbbr_gains.tilt_and_ball_gains(middle)
        between = lqr.margins(A, b, -((low.gains + high.gains) / 2).reshape(1, 4))
        for margins in (low.margins, between, high.margins):
            assert margins.pole < 1
            assert margins.gain_up_dB >= 6
            assert margins.gain_down_dB <= -6
            assert margins.phase_deg >= 35
            assert margins.delay_ticks > 1.2  # 6 ms
            assert margins.pole_one_tick_late < 1
    assert mbbr_gains.design().yaw_margins.delay_ticks > 2


def test_margins_agree_with_brute_force():
    A, b, K = mbbr_gains.tilt_and_ball_gains(HZ * 3)
    margins = lqr.margins(A, b, K)
    assert margins.pole == pytest.approx(lqr.largest_pole(A, b, K))

    def stable(factor):
        return lqr.largest_pole(A, b, factor * K) < 1

    up, down = 10 ** (margins.gain_up_dB / 20), 10 ** (margins.gain_down_dB / 20)
    assert stable(0.999 * up) and not stable(1.001 * up)
    assert stable(1.001 * down) and not stable(0.999 * down)
    turn = np.exp(1j * np.radians(margins.phase_deg))
    assert stable(turn**0.999) and stable(turn**-0.999)
    assert not (stable(turn**1.001) and stable(turn**-1.001))
    ticks = int(margins.delay_ticks)
    assert lqr.largest_pole(*lqr.delayed(A, b, K, ticks)) < 1
    assert lqr.largest_pole(*lqr.delayed(A, b, K, ticks + 1)) > 1


COULOMB = 0.05265  # [T] section 5.3


@pytest.mark.slow
def test_exact_robot_holds_while_spinning_and_driving():
    """10 s at 30 cm/s: true states alone, then friction 70 % compensated and a tick late."""
    rates = (0.0, 1.0, 2.0, 3.0)
    clean = [Scenario(hz) for hz in rates]
    rough = [Scenario(hz, coulomb_N_m=COULOMB, compensation=0.7, delay_ticks=1) for hz in rates]
    outcomes = simulate(clean + rough, duration_s=10.0)
    for scenario, outcome in zip(clean + rough, outcomes, strict=True):
        assert outcome.held, scenario
        assert outcome.yaw_mean_hz == pytest.approx(scenario.yaw_hz, abs=0.01)
        assert outcome.duty_max < 1
    assert all(o.tilt_max_rad < 1e-3 and o.speed_rms_error_m_s < 1e-3 for o in outcomes[:4])
    assert all(o.tilt_max_rad < 0.02 and o.speed_rms_error_m_s < 0.03 for o in outcomes[4:])


def test_simulation_tells_a_fall():
    (outcome,) = simulate([Scenario(3.0, coulomb_N_m=COULOMB, delay_ticks=15)], duration_s=1.0)
    assert not outcome.held
