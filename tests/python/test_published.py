"""What an experiment runs under [T]'s name is config/published.toml, field by field."""

import json
import re
import subprocess
import tomllib

import numpy as np
import pytest
from equipoise_tools import names, published
from equipoise_tools.experiments import framework, published_kf, runs

EKF = "estimator.ekf13_published."
KF = "estimator.kf_attitude."
MODULES = [m for m in map(framework.load, framework.names()) if hasattr(m, "cases")]


def shown(root, config, sets) -> dict:
    command = [root / "build/host/equipoise", "config", "show", "--config", config, "--json", "-"]
    for key, value in sets.items():
        command += ["--set", f"{key}={value}"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def differences(config: dict, expected: dict) -> list[str]:
    return [
        f"{key}: {config.get(key)} is not {value}"
        for key, value in expected.items()
        if config.get(key) != value
    ]


def expected_ekf(section: str, prefix: str = EKF) -> dict:
    table = published.table()
    return {
        prefix + "q": table[section]["q"],
        prefix + "r": table["(6.23)"]["r"],
        prefix + "input_variance": [0.0, 0.0, 0.0],
        prefix + "initial_variance": published.INITIAL_VARIANCE,
    }


def expected_kf() -> dict:
    table = published.table()
    return {
        KF + "model": "published",
        KF + "q": table["(6.32)"]["q_kf"],
        KF + "r": table["(6.23)"]["r_kf"],
        KF + "input_variance": [0.0, 0.0, 0.0],
        KF + "initial_variance": published.INITIAL_VARIANCE,
    }


def expected_gains(where: str) -> dict:
    table = published.table()[where]
    rows = len(table.get("yaw_hz", [0.0]))
    found = {}
    for i in range(rows):
        for key in ("c1", "c2", "c3", "c4", "c5", "c6"):
            found[f"controller.thesis.gains[{i}].{key}"] = table[key][i] if rows > 1 else table[key]
        for key in ("slc_gain", "slc_pole"):
            found[f"reference.schedule[{i}].{key}"] = table[key][i] if rows > 1 else table[key]
        if rows > 1:
            found[f"reference.schedule[{i}].low_pass_rad_s"] = published.table()["6.2.1"]["low_pass_rad_s"][i]
    return found


def expected_control() -> dict:
    table = published.table()
    return {
        "reference.slc_unit_rad_per_rad_s": table["(6.13)"]["slc_unit_rad_per_rad_s"],
        "reference.slc_sign": table["(6.13)"]["slc_sign"],
        "reference.rate_feedback": "euler",
        "reference.filter_frame": "yaw",
        "controller.thesis.yaw_feedforward_s": 0.0,
        "friction.compensation": table["6.2.2"]["compensation"],
    }


def expected_of(case: runs.Case) -> dict:
    """Of everything in a case that stands under [T]'s name."""
    expected = expected_ekf(case.section) if case.section else {}
    if runs.is_kf_published(case):
        expected |= expected_kf()
    if case.gains.startswith("[T] ") and case.gains[4:] in published.table():
        expected |= expected_gains(case.gains[4:])
    if runs.control_of(case, {"controller": case.options.get("controller", "")}) == "thesis as published":
        expected |= expected_control()
    return expected


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__.rpartition(".")[2])
def test_every_published_variant_that_runs_is_the_published_one(module, root):
    seen = {}
    for case in module.cases():
        expected = expected_of(case)
        if expected:
            seen.setdefault(
                json.dumps([case.config, {k: str(v) for k, v in case.settings.items()}]), (case, expected)
            )
    for case, expected in seen.values():
        assert differences(shown(root, case.config, case.settings), expected) == [], case.name


def test_a_tuned_published_filter_is_found(root):
    tuned = {
        **published.ekf("(6.31)"),
        EKF + "r": "[2.08e-6, 2.08e-6, 2.08e-6, 8e-4, 8e-4, 8e-4, 1.41, 1.41]",
    }
    found = differences(shown(root, runs.MBBR, tuned), expected_ekf("(6.31)"))
    assert len(found) == 1
    assert found[0].startswith(EKF + "r")


def test_a_filter_without_a_section_is_refused():
    case = runs.Case("nameless", options={"estimator": "ekf13_published"})
    with pytest.raises(runs.UserError, match="nameless"):
        runs.rows_of(case, 1, traced=False)


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__.rpartition(".")[2])
def test_experiments_run_with_their_own_section(module):
    """The sections in which [T] made the figures and tables that an experiment covers."""
    covered = {re.sub(r",.*", "", target) for target in module.COVERS}
    needed = {
        where for target in covered for where in published.used_in(target) if "q" in published.table()[where]
    }
    sections = {case.section for case in module.cases() if case.section}
    assert not sections or sections >= needed


def test_the_configurations_hold_what_is_published(root):
    table = published.table()
    mbbr, kugle = (shown(root, f"config/{name}.toml", {}) for name in ("mbbr", "kugle"))
    assert differences(mbbr, expected_ekf("(6.31)") | expected_gains("Table 6.3")) == []
    assert differences(kugle, expected_ekf("(6.31)")) == []
    robot = {
        f"robot.{key}": value
        for key, value in table["Table 5.2"].items()
        if key.partition("_")[0] not in ("gravity", "period")
    }
    robot |= {f"robot.{key}": table["5.3"][key] for key in ("coulomb_friction_N_m", "viscous_friction_N_m_s")}
    robot |= {f"motor.{key}": value for key, value in table["6.2.3"].items()}
    assert differences(mbbr, robot) == []
    edumip = shown(root, "config/edumip.toml", {})
    robot = {
        f"robot.{key}": value
        for key, value in table["Table 3.2"].items()
        if key.partition("_")[0] not in ("gravity", "period")
    }
    filters = {
        "estimator.complementary.weight": table["(3.29)"]["weight"],
        "estimator.complementary_kf.q": table["(3.31)"]["q"],
        "estimator.complementary_kf.r": table["(3.31)"]["r"],
        "estimator.planar_kf.q": table["(3.33)"]["q"],
        "estimator.planar_kf.r": table["(3.34)"]["r"],
        "estimator.ekf_published.q": table["(3.48)"]["q"],
        "estimator.ekf_published.r": table["(3.49)"]["r"],
    }
    assert differences(edumip, robot | filters) == []


def test_published_numbers_follow_from_each_other():
    """(6.16) from 6.2.3, T_ob (6.5) orthonormal but for its misprint, mu_c / k1 from 5.3 and Table 5.2."""
    table = published.table()
    motor = table["6.2.3"]
    assert motor["nominal_V"] / motor["resistance_ohm"] == pytest.approx(
        table["(6.16)"]["stall_current_A"], abs=5e-3
    )
    T_r = motor["resistance_ohm"] / motor["inductance_H"] / motor["pwm_hz"]
    assert T_r == pytest.approx(table["(6.16)"]["T_r"], abs=1e-3)
    assert motor["nominal_V"] / motor["torque_constant_N_m_A"] == pytest.approx(108.0, abs=0.5)
    assert table["5.3"]["coulomb_friction_N_m"] / table["Table 5.2"]["k1_N_m"] == pytest.approx(
        0.30, abs=2e-3
    )
    assert np.array(table["(6.5)"]["T_ob"])[:2] @ np.array(table["(6.5)"]["T_ob"])[:2].T == pytest.approx(
        np.eye(2), abs=2e-4
    )


def test_the_linear_kf_of_the_firmware_is_the_published_recursion(root):
    """kf_attitude with `model = "published"` against (5.27)-(5.29) computed here from the log's samples."""
    log = runs.simulate(
        sets=published.kf(),
        estimator="kf_attitude",
        controller="thesis",
        yaw_hz=0.5,
        duration_s=6.0,
        fidelity="nominal",
    )[1]
    geometry = runs.equipoise_json("geometry", "--alpha-deg", 60, "--azimuth-deg", -140)
    states = published_kf.estimate(log, np.array(geometry["T_ob"]))
    ours = log[names.STATE]["phi_dot_rad_s"][:, :2]
    settled = slice(400, min(len(states), len(ours)))
    rms = np.sqrt(np.mean(ours[settled] ** 2))
    assert np.sqrt(np.mean((states[settled, 6:] - ours[settled]) ** 2)) < 0.02 * rms


def test_the_file_is_only_numbers_with_a_place(root):
    written = tomllib.loads((root / "config/published.toml").read_text(encoding="utf-8"))
    place = re.compile(r"\(\d\.\d+\)|Table \d\.\d|\d(\.\d)+")
    assert all(place.fullmatch(name) for name in written)
