"""The MIP's controllers: the published one's poles, our margins, and the exact robot holding."""

import re

import numpy as np
import pytest
from derive import mip
from reference_design import lqr, mip_gains
from reference_design.mip_simulation import Scenario, simulate


def test_published_coefficients_have_the_known_poles():
    assert round(mip_gains.slc_pole(mip_gains.PUBLISHED, 200), 4) == 0.9986
    assert round(mip_gains.slc_pole(mip_gains.PUBLISHED, 100), 4) == 0.9979


def test_coefficients_as_printed_are_unstable():
    assert round(mip_gains.slc_pole(mip_gains.AS_PRINTED, 200), 3) == 1.024


LATE = {"slc": (6.0, 35.0, 2.0), "lqr": (4.0, 23.0, 0.6)}  # dB, degrees, further ticks


@pytest.mark.parametrize("lateral", [0.0, 1.0])
@pytest.mark.parametrize("yaw_rate", mip_gains.YAW_RATES)
@pytest.mark.parametrize("controller", ["slc", "lqr"])
def test_margins_with_one_tick_lost(controller, yaw_rate, lateral):
    """At every yaw rate of the experiments, for either form of the dynamics; a tick that the chain does not
    lose (test_design_command.py has that)."""
    margins = mip_gains.margins(controller, yaw_rate, lateral, late_ticks=1)
    gain_dB, phase_deg, ticks = LATE[controller]
    assert margins.pole < 0.9985  # the soft wheel loop
    assert margins.gain_up_dB >= gain_dB
    assert margins.gain_down_dB <= -gain_dB
    assert margins.phase_deg >= phase_deg
    assert margins.delay_ticks > ticks


def test_the_page_has_these_margins(root):
    page = (root / "docs/derivation.md").read_text(encoding="utf-8")
    for controller in ("published", "slc", "lqr"):
        row = re.search(rf"^\| `?{controller}\b[^|]*\| 0 / 10 \|(.*)\|$", page, re.M)[1]
        cells = [
            re.findall(r"\d+(?:\.\d+)?", re.sub(r"ticks of \d+ ms", "", cell)) for cell in row.split("|")
        ]
        at = [mip_gains.margins(controller, yaw_rate, late_ticks=1) for yaw_rate in (0.0, 10.0)]
        names = (("pole",), ("gain_down_dB", "gain_up_dB"), ("phase_deg",), ("delay_ticks",))
        for quoted, of in zip(cells, names, strict=True):
            known = [abs(getattr(m, name)) for name in of for m in at]
            for number in quoted:
                half = 0.501 * 10.0 ** -len(number.partition(".")[2])
                assert min(abs(float(number) - k) for k in known) <= half, (controller, number)
    unstable = [np.linalg.eigvals(mip_gains.planar_system(y)[0]).real.max() for y in (0.0, 10.0)]
    assert "from {:.1f} to {:.1f} rad/s at 10 rad/s".format(*unstable) in page


def test_redesign_is_better_than_the_published_one_at_every_yaw_rate():
    """But for the slowest pole at rest: the wheel loop is as soft as its."""
    for yaw_rate in mip_gains.YAW_RATES:
        ours, theirs = (mip_gains.margins(c, yaw_rate, late_ticks=0) for c in ("slc", "published"))
        assert ours.pole < max(theirs.pole, 0.9981)
        assert ours.phase_deg > theirs.phase_deg
        assert ours.gain_down_dB < theirs.gain_down_dB


def test_slc_loop_is_the_product_of_its_transfer_functions():
    """The state-space loop against D1 (G_theta + D2 G_phi) at a few frequencies."""
    slc = mip_gains.slc_design()
    A, b = lqr.sampled(*mip_gains.planar_system(), 1 / slc.rate_hz)
    whole, b_whole, K = mip_gains.slc_loop(slc, A, b)
    for w in (0.02, 0.3, 1.5):
        z = np.exp(1j * w)
        D1, D2 = (np.polyval(tf[0], z) / np.polyval(tf[1], z) for tf in (slc.D1, slc.D2))
        theta, phi = np.linalg.solve(z * np.eye(4) - A, b)[:2, 0]
        loop = (K @ np.linalg.solve(z * np.eye(8) - whole, b_whole))[0, 0]
        assert loop == pytest.approx(D1 * (theta + D2 * phi))


def test_inner_loop_integrates_and_outer_loop_does_not():
    slc = mip_gains.slc_design()
    assert np.polyval(slc.D1[1], 1.0) == pytest.approx(0, abs=1e-12)
    assert np.polyval(slc.D2[0], 1.0) / np.polyval(slc.D2[1], 1.0) == pytest.approx(0.0071, rel=0.01)


def test_yaw_loop_and_feedforward():
    angle, rate = mip_gains.yaw_gains()
    assert angle > 0
    assert rate > 0
    A, b = mip_gains.yaw_system()
    steady = A[1, 1] + b[1, 0] * mip_gains.yaw_feedforward()
    assert steady == pytest.approx(0)
    p = mip_gains.parameters()
    assert mip_gains.yaw_feedforward() == pytest.approx(p["d"] * p["k2"] / (2 * p["r"] * p["k1"]))
    Ad, bd = lqr.sampled(A, b, 0.005)
    assert lqr.margins(*lqr.delayed(Ad, bd, np.array([[angle, rate]]), 1)).delay_ticks > 2


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["slc", "lqr"])
def test_exact_robot_balances_while_spinning(controller):
    """A tick late, quantised encoders, 10 % of the motors' torque lost to friction, from 0.1 rad of tilt."""
    scenarios = [
        Scenario(controller, yaw, lateral, 0.1 * mip.TABLE_3_2["k1"], delay_ticks=1)
        for yaw in mip_gains.YAW_RATES
        for lateral in (0.0, 1.0)
    ]
    for scenario, outcome in zip(scenarios, simulate(scenarios, duration_s=6.0), strict=True):
        assert outcome.held, scenario
        assert outcome.tilt_rms_rad < 0.04
        assert outcome.wheel_rms_rad < 0.5
        assert outcome.yaw_mean_rad_s == pytest.approx(scenario.yaw_rad_s, abs=0.1)
