"""`equipoise design`: the firmware's own gains against SciPy, and what it says of the loop."""

import json
import subprocess

import numpy as np
import pytest
from reference_design import lqr, mbbr_gains, mbbr_linear, mip_gains
from scipy import linalg


def design(root, robot, *arguments):
    command = [
        root / "build/host/equipoise",
        "design",
        "--config",
        root / f"config/{robot}.toml",
        "--json",
        "-",
    ]
    run = subprocess.run([*command, *arguments], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def matrix(pairs):
    values = np.array(pairs)
    return values[..., 0] + 1j * values[..., 1]


def relative(a, b):
    return np.max(np.abs(np.asarray(a) - np.asarray(b))) / np.max(np.abs(b))


@pytest.mark.parametrize("delay_s", [0.0, 0.0012])
def test_mbbr_gains_are_scipys(root, delay_s):
    d = design(
        root, "mbbr", "--set", f"controller.scheduled.design.input_delay_s={delay_s}", "--step-hz", "0.75"
    )
    w = mbbr_gains.weights()
    deviations = [w[k] for k in ("theta_rad", "phi_rad", "body_rate_rad_s", "phi_dot_rad_s")]
    assert len(d["rows"]) == 5
    for row in d["rows"]:
        A, b = mbbr_linear.complex_system(2 * np.pi * row["yaw_hz"])
        assert relative(matrix(row["lqr"]["A"]), A) < 1e-9
        assert relative(matrix(row["lqr"]["b"]), b[:, 0]) < 1e-9
        late, b_late = lqr.sampled(A, b, delay_s) if delay_s else (np.eye(4), np.zeros((4, 1)))
        fresh, b_new = lqr.sampled(A, b, mbbr_gains.TICK_S - delay_s)
        whole = np.block([[fresh @ late, fresh @ b_late], [np.zeros((1, 5))]])
        b_whole = np.vstack([b_new, [[1]]])
        if delay_s:
            K = lqr.lqr(whole, b_whole, [*(v**-2 for v in deviations), 0.0], [w["u"] ** -2])
        else:
            K = np.hstack([lqr.lqr(fresh, b_new, [v**-2 for v in deviations], [w["u"] ** -2]), [[0]]])
        assert relative(matrix(row["lqr"]["K"]), K[0]) < 1e-9
        ours = matrix(row["lqr"]["poles"])
        for pole in linalg.eigvals(whole - b_whole @ K):
            assert np.min(np.abs(ours - pole)) < 1e-8
    assert d["gains"]["yaw_angle"] == pytest.approx(-mbbr_gains.yaw_gains()[2][0, 0], rel=1e-9)
    assert d["gains"]["yaw_rate"] == pytest.approx(-mbbr_gains.yaw_gains()[2][0, 1], rel=1e-9)
    terms = mbbr_gains.reference_terms()
    for name in ("speed", "speed_turn", "lean", "drive"):
        assert d["gains"][name] == pytest.approx(getattr(terms, name), rel=1e-9)


def test_mip_gains_are_scipys(root):
    g = design(root, "edumip", "--last-hz", "0")["gains"]
    assert relative(g["lqr"][:4], mip_gains.lqr_gains()) < 1e-9
    assert relative([g["yaw_angle"], g["yaw_rate"]], mip_gains.yaw_gains()) < 1e-9
    slc = mip_gains.slc_design()
    for name in ("D1", "D2"):
        top, bottom = getattr(slc, name)
        assert relative(g[name]["numerator"], top) < 1e-9
        assert relative(g[name]["denominator"], bottom) < 1e-9


def test_a_delay_in_the_chain_costs_as_much_delay_margin(root):
    def margins(*arguments):
        off = [f"--set=chain.{k}_delay_s=0" for k in ("gyro", "accel", "actuation")]
        return design(root, "mbbr", "--last-hz", "0", *off, *arguments)["rows"][0]["margins"]

    prompt, late = margins(), margins("--set=chain.gyro_delay_s=0.0017")
    assert late["gyro"]["delay_ms"] == pytest.approx(prompt["gyro"]["delay_ms"] - 1.7, abs=0.2)  # sampled: not quite
    late = margins("--set=chain.actuation_delay_s=0.002")
    assert late["u"]["gain_up_dB"] < prompt["u"]["gain_up_dB"]
    assert late["u"]["delay_ms"] < prompt["u"]["delay_ms"]


def test_an_unknown_choice_is_refused(root):
    command = [root / "build/host/equipoise", "design", "--config", root / "config/mbbr.toml"]
    run = subprocess.run([*command, "--controller", "slc"], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "thesis, scheduled" in run.stderr
