"""`equipoise design`: the firmware's own gains against SciPy, and what it says of the loop."""

import json
import re
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


def shortfalls(design):
    """Where the margins of a design are below what a built robot needs."""
    for row in design["rows"]:
        if not row["stable"]:
            yield f"{row['yaw_hz']} Hz: unstable"
        for place, m in row["margins"].items():
            wanted = {"gain_up_dB": 6.0, "gain_down_dB": 6.0, "delay_ms": 6.0}
            wanted["phase_deg"] = 35.0 if place == "encoder" else 40.0
            for name, least in wanted.items():
                if m[name] is not None and abs(m[name]) < least:
                    yield f"{row['yaw_hz']} Hz, {place}: {name} {m[name]:.2f}"


def test_the_shipped_design_has_every_margin_at_every_yaw_rate(root):
    assert list(shortfalls(design(root, "mbbr"))) == []


@pytest.mark.parametrize(
    ("setting", "missed"),
    [
        ("controller.scheduled.design.phi_dot_rad_s=5.0", "encoder: gain_up_dB"),
        ("controller.scheduled.design.body_rate_rad_s=0.2", "gyro: phase_deg"),
        ("estimator.ekf.r=[2.08e-6,2.08e-6,2.08e-6,7.9e-5,7.9e-5,7.9e-5,1.41,1.41]", "encoder: gain_up_dB"),
        ("chain.actuation_delay_s=0.0049", "u: gain_up_dB"),
    ],
)
def test_margins_tell_a_bad_weight_a_bad_filter_and_a_late_chain(root, setting, missed):
    rates = ("--step-hz", "1.5")
    assert any(missed in s for s in shortfalls(design(root, "mbbr", f"--set={setting}", *rates)))


def test_the_page_says_what_a_gain_on_the_balls_rate_costs(root):
    page = (root / "docs/derivation.md").read_text(encoding="utf-8")
    told = re.search(
        r"weights theta ([\d.]+), phi ([\d.]+), body rate ([\d.]+), phi\*' ([\d.]+) have (.*?)\.\s",
        page,
        re.S,
    )
    names = ("theta_rad", "phi_rad", "body_rate_rad_s", "phi_dot_rad_s")
    weights = [
        f"--set=controller.scheduled.design.{n}={v}" for n, v in zip(names, told.groups(), strict=False)
    ]
    rows = design(root, "mbbr", *weights, "--last-hz", "3", "--step-hz", "0.5")["rows"]

    def least(place, *names):
        return min(abs(row["margins"][place][name]) for row in rows for name in names)

    gain = ("gain_up_dB", "gain_down_dB")
    found = [least("gyro", "phase_deg"), least("gyro", *gain), least("encoder", "phase_deg")]
    found += [least("encoder", *gain), least("u", "phase_deg")]
    quoted = [float(number) for number in re.findall(r"\d+(?:\.\d+)?", told[5])]
    assert [round(f, 0 if f > 10 else 1) for f in found] == quoted


def test_gains_poles_and_margins_are_printed(root):
    command = [
        root / "build/host/equipoise",
        "design",
        "--config",
        root / "config/mbbr.toml",
        "--step-hz",
        "3",
    ]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    for word in ("K  ", "poles", "gain, dB", "phase, deg", "delay margin"):
        assert word in text
    row = design(root, "mbbr", "--last-hz", "0")["rows"][0]
    assert f"{row['lqr']['K'][0][0]:.5g}" in text
    assert f"{row['lqr']['poles'][0][0]:.5g}" in text


@pytest.mark.parametrize("controller", ["slc", "lqr"])
def test_the_shipped_edumip_has_every_margin_at_every_yaw_rate(root, controller):
    places = ("--controller", controller, "--last-hz", "1.6", "--step-hz", "0.1")
    made = design(root, "edumip", *places)
    assert list(shortfalls(made)) == []
    page = (root / "docs/derivation.md").read_text(encoding="utf-8")
    table = page.partition("| | broken at |")[2].partition(f"| `{controller}` ")[2]
    for line, place in zip(table.splitlines(), ("u", "gyro", "encoder"), strict=False):
        quoted = [float(number) for number in re.findall(r"[-+]?\d+(?:\.\d+)?", line)]
        of_all = [row["margins"][place] for row in made["rows"]]
        names = ("gain_down_dB", "gain_up_dB", "phase_deg", "delay_ms")
        least = [min((m[name] for m in of_all if m[name] is not None), key=abs) for name in names]
        assert f"| {place} |" in line
        assert quoted == pytest.approx(least, rel=3e-3, abs=0.06)


def test_margins_tell_a_stiff_wheel_loop(root):
    """It is the wheel loop against the tilt loop that the gyro's and the encoders' margins ask about."""
    stiff = "--set=controller.slc.design.outer_gain_pp_a=0.03"
    rows = design(root, "edumip", stiff, "--controller", "slc", "--last-hz", "1.6", "--step-hz", "0.8")
    assert any("gyro: " in s for s in shortfalls(rows))


def test_the_picture_is_drawn(root, tmp_path):
    from equipoise_tools import design as picture

    file = tmp_path / "design.json"
    file.write_text(json.dumps(design(root, "mbbr", "--bode", "--step-hz", "3")))
    assert picture.main([str(file), "--output", str(tmp_path / "design.png")]) == 0
    assert (tmp_path / "design.png").read_bytes().startswith(b"\x89PNG")
    file.write_text(json.dumps(design(root, "mbbr", "--last-hz", "0")))
    assert picture.main([str(file), "--output", str(tmp_path / "none.png")]) == 2


def test_an_unknown_choice_is_refused(root):
    command = [root / "build/host/equipoise", "design", "--config", root / "config/mbbr.toml"]
    run = subprocess.run([*command, "--controller", "slc"], capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "thesis, scheduled" in run.stderr
