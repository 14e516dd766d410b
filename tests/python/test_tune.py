"""Tuning: what is set, what a choice costs, which designs are not run, and who judges."""

import json
import tomllib

import pytest
from equipoise_tools import tune
from equipoise_tools.tuned_run import NotRun, Runs

WORTH = {"attitude_rmse_rad": 0.005}


def outcome(error, fell=False):
    return {"fell": fell, "attitude_rmse_rad": None if fell else error}


@pytest.mark.parametrize("robot", ["mbbr", "edumip"])
def test_every_knob_is_a_key_of_the_shipped_configuration(root, robot):
    config = tomllib.loads((root / f"config/{robot}.toml").read_text(encoding="utf-8"))
    for knob in tune.KNOBS[config["robot"]["type"]]:
        value = tune.value_at(config, knob.key)
        assert all(value[i] >= 0.0 for i in knob.indexes) if knob.indexes else value > 0.0
        assert knob.low < 1.0 < knob.high


def test_settings_scale_the_elements_of_each_knob_and_no_other():
    config = {"a": {"r": [1.0, 2.0, 3.0], "w": 4.0}}
    knobs = (
        tune.Knob("first", "a.r", (0,), 0.1, 10.0),
        tune.Knob("last", "a.r", (2,), 0.1, 10.0),
        tune.Knob("weight", "a.w", (), 0.1, 10.0),
    )
    words = tune.settings(config, knobs, {"first": 2.0, "last": 10.0, "weight": 0.5})
    assert words == ["a.r=[2.0, 2.0, 30.0]", "a.w=2.0"]
    assert config["a"]["r"] == [1.0, 2.0, 3.0]


def test_a_fall_costs_more_than_any_error():
    assert tune.cost([outcome(0.005), outcome(0.010)], WORTH) == pytest.approx((1.0 + 4.0) / 2)
    assert tune.cost([outcome(0.005), outcome(0.0, fell=True)], WORTH) == pytest.approx(
        (1 + tune.FALL_COSTS) / 2
    )


def test_tunings_are_compared_robot_by_robot():
    shipped = [outcome(0.001 * i) for i in range(1, 21)]
    tuned = [outcome(0.0005 * i) for i in range(1, 20)] + [outcome(0.0, fell=True)]
    told = tune.compare(shipped, tuned, WORTH)
    assert told["ratio"]["attitude_rmse_rad"] == pytest.approx({"median": 0.5, "low": 0.5, "high": 0.5})
    assert (told["shipped"]["upright"], told["tuned"]["upright"]) == (20, 19)


def test_a_design_that_misses_a_margin_is_not_run(root, tmp_path):
    judged = Runs(
        root / "build/host/equipoise", root / "config/mbbr.toml", [(0.0, 0.0)], 10.0, "built2025", tmp_path
    )
    judged.check_margins([])
    with pytest.raises(NotRun):
        judged.check_margins(["controller.scheduled.design.theta_rad=0.01"])


def test_the_robots_that_judge_are_not_those_that_choose(capsys):
    with pytest.raises(SystemExit):
        tune.arguments(["--training", "16", "--first-held-out", "16"])
    assert "robots that judge" in capsys.readouterr().err


def test_a_study_starts_at_the_shipped_values_and_reports_on_others(root, tmp_path):
    pytest.importorskip("optuna", reason="needs optuna (tools/requirements-optional.txt)")
    small = ["--trials", "2", "--training", "1", "--held-out", "2", "--duration-s", "10", "--runs", "0,0.1"]
    assert tune.main(["--config", str(root / "config/mbbr.toml"), *small, "--out", str(tmp_path)]) == 0
    told = json.loads((tmp_path / "mbbr.json").read_text())
    assert told["trials"] == 2
    assert told["cost_tuned"] <= told["cost_shipped"]
    assert (told["held_out"]["first"], told["held_out"]["last"]) == (4001, 4002)
    assert "Held out: robots 4001 to 4002" in (tmp_path / "mbbr.md").read_text()
