"""The campaign: its statistics, page and resuming; trials that do not depend on the number of threads."""

import argparse
import json
import subprocess
import sys

import numpy as np
import pytest
from equipoise_tools import as_built, campaign, campaign_page
from equipoise_tools.campaign_statistics import (
    influences,
    quantile_interval,
    ranks,
    separation,
    survival_over_time,
    wilson,
)

SETTINGS = {
    "config": "config/mbbr.toml",
    "fidelity": "full",
    "duration_s": 60.0,
    "estimator": "",
    "controller": "",
    "set": ["friction.compensation=0.9"],
    "engine": "own",
    "floor": "calm",
    "twins": False,
    "version": "1",
}


def row(robot, fell, **drawn):
    return {
        "robot": robot,
        "seed": 1,
        "yaw_hz": 1.0,
        "drive_mps": 0.2,
        "duration_s": 60.0,
        "fell": fell,
        "fell_at_s": 10.0 + robot if fell else None,
        "ended": "fell" if fell else "finished",
        "reasons": ["tilt"] if fell else [],
        "attitude_rmse_rad": 0.001 * robot,
        "drawn": drawn,
    }


def test_wilson_is_the_textbook_interval():
    assert wilson(10, 10) == pytest.approx((0.7225, 1.0), abs=1e-4)
    assert wilson(50, 100) == pytest.approx((0.4038, 0.5962), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_quantiles_lie_in_their_interval_as_often_as_it_says():
    rng = np.random.default_rng(1)
    for share, true in ((0.5, 0.0), (0.95, 1.6448536)):
        held = 0
        for _ in range(1000):
            _, low, high = quantile_interval(rng.normal(size=200), share)
            held += low <= true <= high
        assert 930 <= held <= 990  # of 950 wanted: ranks are whole numbers


def test_errors_are_those_of_the_upright():
    rows = [{**row(r, r > 4), "heading_error_rad": -0.1 * r} for r in range(1, 8)]
    table = campaign_page.error_table(rows)
    assert "| 1 | 0.2 | attitude RMSE, rad | 0.0025 (0.0010 - 0.0040) | 0.0038 (0.0030 - 0.0040) |" in table
    assert any("heading error at the end, rad | 0.250" in line for line in table)
    assert not any("position" in line for line in table)  # not measured


def test_separation_is_the_share_of_pairs():
    assert ranks(np.array([3.0, 1.0, 1.0])).tolist() == [3.0, 1.5, 1.5]
    fell = np.array([True, True, False, False])
    assert separation(np.array([4.0, 3.0, 2.0, 1.0]), fell)[0] == 1.0
    assert separation(np.array([4.0, 1.0, 3.0, 2.0]), fell)[0] == 0.5
    assert separation(np.ones(4), np.zeros(4, dtype=bool)) == (0.5, 0.0)


def test_the_imperfection_that_kills_comes_first_whatever_its_sign():
    rng = np.random.default_rng(1)
    tilted = rng.normal(size=400)
    drawn = {"tilted": tilted, "sticky": rng.uniform(size=400)}
    found = influences(drawn, np.abs(tilted) > 1.5)
    assert (found[0].name, found[0].measure) == ("tilted", "size")
    assert found[0].z > 8.0
    assert abs(found[1].z) < 3.5


def test_survival_over_time_falls_with_each_robot():
    times, left = survival_over_time(np.array([2.0, np.nan, 1.0, np.nan]), 60.0)
    assert times.tolist() == [0.0, 1.0, 2.0, 60.0]
    assert left.tolist() == [1.0, 0.75, 0.5, 0.5]


def test_the_page_tells_shares_and_how_to_see_the_worst_again(tmp_path):
    rows = [row(robot, robot <= 5, mount=float(robot <= 5)) for robot in range(1, 21)]
    text = campaign_page.write_page(rows, SETTINGS, tmp_path).read_text()
    assert "| 1 | 0.2 | 20 | 75.00 % |" in text
    first = next(line for line in text.splitlines() if line.startswith("- robot"))
    assert "robot 1: fell at 11.00 s (tilt)" in first
    assert (
        "sim --config config/mbbr.toml --fidelity full --robot 1 --seed 1 --yaw-hz 1 --drive-mps 0.2" in first
    )
    assert "--set friction.compensation=0.9" in first
    assert "| `mount` |" in text
    assert "Of the upright" not in text
    for number, one in enumerate(rows):
        one["excluded_healthy"], one["drawn"]["shaken"] = number >= 15, float(number >= 15)
    doubted = campaign_page.page(rows, SETTINGS).partition("Of the upright")[2].partition("## Worst")[0]
    assert "| `shaken` |" in doubted and "| `mount` |" not in doubted
    assert (tmp_path / "survival.png").stat().st_size > 10_000
    assert (tmp_path / "sensitivity.png").stat().st_size > 5_000


def test_an_interrupted_campaign_runs_only_what_is_missing(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    pytest.importorskip("dask.distributed", reason="dask is not installed")
    ran = []

    def fake_chunk(program, settings, trials):
        ran.extend(campaign.identity(trial) for trial in trials)
        if len(ran) > 6 and not resumed:
            raise campaign.UserError("the power went off")
        return [
            row(t["robot"], False, x=0.5) | {k: t[k] for k in ("seed", "yaw_hz", "drive_mps")} for t in trials
        ]

    resumed = False
    monkeypatch.setattr(campaign, "run_chunk", fake_chunk)
    monkeypatch.setattr(campaign, "settings_of", lambda given: SETTINGS)
    monkeypatch.setattr(campaign, "binary", lambda: "unused")
    words = [
        "--robots",
        "5",
        "--runs",
        "0,0.1",
        "1,0.1",
        "--chunk",
        "3",
        "--workers",
        "1",
        "--out",
        str(tmp_path),
    ]
    assert campaign.main(words) == 2
    kept = {campaign.identity(r) for r in campaign.read_parts(tmp_path)}
    assert 0 < len(kept) < 10
    ran.clear()
    resumed = True
    assert campaign.main(words) == 0
    assert not kept & set(ran)
    assert len(campaign.read_parts(tmp_path)) == 10
    monkeypatch.setattr(campaign, "settings_of", lambda given: SETTINGS | {"duration_s": 1.0})
    assert campaign.main(words) == 2


def test_bad_runs_are_refused():
    with pytest.raises(argparse.ArgumentTypeError):
        campaign.pair("fast")


def trials(root, tmp_path, rows, *arguments, text=None):
    request = tmp_path / "trials.json"
    written = json.dumps({"trials": rows})
    for old, new in (text or {}).items():
        written = written.replace(old, new)
    request.write_text(written)
    command = [
        root / "build/host/equipoise",
        "trials",
        "--config",
        root / "config/mbbr.toml",
        "--in",
        request,
    ]
    return subprocess.run([*map(str, command), *arguments], capture_output=True, text=True, check=False)


def test_trials_have_the_same_bytes_on_one_thread_and_on_three(root, tmp_path):
    rows = [{"robot": robot, "duration_s": 1.5, "fidelity": "full"} for robot in range(5)]
    one = trials(root, tmp_path, rows, "--jobs", "1")
    assert one.returncode == 0, one.stderr
    assert trials(root, tmp_path, rows, "--jobs", "3").stdout == one.stdout
    out = json.loads(one.stdout)["trials"]
    assert [r["robot"] for r in out] == [0, 1, 2, 3, 4]
    assert out[0]["drawn"] == {}
    assert out[1]["drawn"] != out[2]["drawn"]


@pytest.mark.parametrize("seed", ["-1", "1.5", "1e300", '"7"', "null", "1e999"])
def test_a_seed_is_a_whole_number(root, tmp_path, seed):
    refused = trials(root, tmp_path, [{"seed": "SEED", "duration_s": 1}], text={'"SEED"': seed})
    assert refused.returncode == 2 and refused.stdout == ""
    assert (
        "trials.json: holds a number that is too large" if seed == "1e999" else "seed: "
    ) in refused.stderr


def test_a_trial_is_the_same_run_as_sim(root, tmp_path):
    rows = [{"robot": 2, "seed": 7, "duration_s": 6.0, "drive_mps": 0.1, "fidelity": "nominal"}]
    trial = json.loads(trials(root, tmp_path, rows, "--set", "population.battery_V=[7.5, 7.6]").stdout)[
        "trials"
    ][0]
    command = [root / "build/host/equipoise", "sim", "--config", root / "config/mbbr.toml", "--robot", "2"]
    command += [
        "--seed",
        "7",
        "--duration-s",
        "6",
        "--drive-mps",
        "0.1",
        "--fidelity",
        "nominal",
        "--telemetry",
        "off",
    ]
    command += ["--set", "population.battery_V=[7.5, 7.6]", "--log", tmp_path / "a.lcm", "--json", "-"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    sim = json.loads(done.stdout)
    for key in ("fell", "fell_at_s", "attitude_rmse_rad", "ball_speed_rmse_m_s", "duty_max"):
        assert trial[key] == sim[key], key


def test_trials_refuse_what_they_do_not_know(root, tmp_path):
    done = trials(root, tmp_path, [{"robots": 2}])
    assert done.returncode == 2
    assert "robots" in done.stderr


def test_campaigns_run_again_take_their_place_on_the_page_and_leave_the_others():
    page = "\n".join(
        ["# Old", "## A", "1", "### of A", "## B", "2", "## Filter and controller, step by step", "3"]
    )
    text = as_built.renewed(page, ["## B\nnew\n", "## C\nnew\n", as_built.STEPS_HEAD + "new\n"])
    steps = "## Filter and controller, step by step\nnew\n"
    assert text == as_built.HEAD + "## A\n1\n### of A\n## B\nnew\n## C\nnew\n" + steps


def test_an_unknown_world_is_refused_with_the_known_ones(capsys):
    with pytest.raises(SystemExit, match="2"):
        campaign.main(["--fidelity", "nosuch"])
    assert "invalid choice: 'nosuch'" in capsys.readouterr().err


def test_what_the_user_can_mend_is_one_line(tmp_path):
    command = [
        sys.executable,
        "-m",
        "equipoise_tools.animate",
        tmp_path / "no.lcm",
        "--out",
        tmp_path / "a.gif",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert ended.stderr == f"error: {tmp_path}/no.lcm: No such file or directory\n"
