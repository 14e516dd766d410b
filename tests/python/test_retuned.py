"""replay --set: another tuning beside a recorded run."""

import json
import math
import re
import tomllib

import pytest
from equipoise_robot import Log
from test_blackbox import equipoise_run, replay, simulate


@pytest.mark.parametrize("robot", ["mbbr", "edumip"])
def test_the_same_tuning_beside_a_run_does_what_the_run_did(root, tmp_path, robot):
    config = root / f"config/{robot}.toml"
    was = re.search(r"^compensation = (\S+)", config.read_text(), re.M)[1]
    log = simulate(root, tmp_path / "run.lcm", config=config, seconds=8)
    beside = replay(root, log, "--set", f"friction.compensation={was}")[1]["retuned"]
    assert beside["changed"] == beside["recorded"] and beside["not_armed_ticks"] == 0
    assert beside["changed"]["duty_rms"] > 0 and beside["changed"]["normalized_innovation_mean"] > 0
    assert beside["difference"]["attitude_rmse_rad"] == 0 and beside["difference"]["ticks"] == 601
    other = tmp_path / "other.lcm"
    weaker = replay(root, log, "--set", f"friction.compensation={float(was) / 2}", "--log", other)[1][
        "retuned"
    ]
    assert weaker["changed"]["duty_rms"] < beside["recorded"]["duty_rms"]
    assert weaker["difference"]["attitude_rmse_rad"] == 0  # the filter gets what the run did to the motors
    told, ours = Log(other), Log(log)
    assert told.run.backend == "replay" and told.run.robot == ours.run.robot
    assert tomllib.loads(told.run.config_toml)["friction"]["compensation"] == float(was) / 2
    assert len(told.sensors()) == len(ours.sensors())


@pytest.mark.parametrize(
    "robot, estimator", [("mbbr", "ekf13"), ("mbbr", "kf_attitude"), ("edumip", "planar_kf")]
)
def test_another_filters_noise_is_tried_on_a_recorded_run(root, tmp_path, robot, estimator):
    """As it was in a simulation with that noise, whose run is the same: another filter is in control."""
    config = root / f"config/{robot}.toml"
    table = config.read_text().split(f"[estimator.{estimator}]")[1].split("\n[")[0]
    noise = [float(x) for x in re.search(r"^r = \[(.*?)\]", table, re.M)[1].split(",")]
    change = f"estimator.{estimator}.r={[100.0 * noise[0], *noise[1:]]}"
    summary = tmp_path / "sim.json"
    simulate(
        root,
        tmp_path / "other.lcm",
        "--compare",
        "--set",
        change,
        "--json",
        summary,
        config=config,
        seconds=8,
    )
    expected = json.loads(summary.read_text())["estimators"][estimator]["attitude_rmse_rad"]
    log = simulate(root, tmp_path / "run.lcm", config=config, seconds=8)
    beside = replay(root, log, "--estimator", estimator, "--set", change)[1]["retuned"]
    factor = math.sqrt(2) if robot == "edumip" else 1  # replay counts two axes
    assert factor * beside["changed"]["errors"]["attitude_rmse_rad"] == pytest.approx(expected, rel=1e-9)
    assert beside["changed"]["errors"] != beside["recorded"]["errors"]
    assert beside["set"] == [change] and beside["estimator"] == estimator


def test_a_tuning_that_cannot_be_is_refused_in_one_line(root, tmp_path):
    log = simulate(root, tmp_path / "run.lcm", seconds=1)
    for change in ("estimator.ekf.R=1", "friction.compensation=often"):
        ended = equipoise_run(root, "replay", log, "--set", change)
        assert ended.returncode == 2 and len(ended.stderr.splitlines()) == 1
        assert change.split("=")[0] in ended.stderr
