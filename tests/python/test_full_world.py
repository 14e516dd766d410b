"""Every effect of the population can be turned off; two engines' verdicts are compared run by run."""

import json
import subprocess
import tomllib

from equipoise_tools import agreement, full_world
from equipoise_tools.trials import run_trials


def leaves(table, prefix=""):
    for name, value in table.items():
        if isinstance(value, dict) and "sigma" not in value:
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield prefix + name


def test_every_key_of_the_population_is_an_effects(root):
    config = tomllib.loads((root / "config/mbbr.toml").read_text())
    off = {key for keys in full_world.EFFECTS.values() for key in keys}
    drawn = set(leaves(config["population"]))
    # How strongly or when, of an effect whose other key turns it off.
    of_others = {
        "vibration.excess_kurtosis",
        "floor.heading_rad",
        "random_pushes.force_N",
        "disturbance.gearbox_friction_share",
        "disturbance.floor_torsion_radius_m",
        "disturbance.imu_delay_scale",
        "disturbance.friction_time_s",
        "disturbance.warm_K",
        "disturbance.warm_up_K",
    }
    assert drawn - off == of_others
    world = set(leaves(config["world"]["full"]))
    assert off <= world


def test_effects_alone_leave_the_others_out(tmp_path, monkeypatch):
    asked = []

    def trials(_config, _asked, settings):
        asked.append([f"{key}={value}" for key, value in settings.items()])
        return []

    monkeypatch.setattr(full_world, "run_trials", trials)
    runs = full_world.Trials(tmp_path, range(1, 3))
    runs.run("mbbr", "firmware", (0.0, 0.0), "alone wheel slip+pushes")
    runs.run("mbbr", "firmware", (0.0, 0.0), "without pushes")
    runs.run("mbbr", "firmware", (0.0, 0.0), "without pushes")  # there already
    assert "world.full.disturbance.wheel_grip=0" not in asked[0]
    assert "world.full.random_pushes.every_s=0" not in asked[0]
    assert "world.full.disturbance.backlash_rad=0" in asked[0]
    assert asked[1:] == [["world.full.random_pushes.every_s=0"]]


def row(robot, reason="", error=0.01):
    return {
        "robot": robot,
        "seed": robot,
        "yaw_hz": 1.0,
        "drive_mps": 0.2,
        "fell": bool(reason),
        "reasons": [reason] if reason else [],
        "ended": "finished",
        "attitude_rmse_rad": error,
        "yaw_frame_speed_rmse_m_s": 2.0 * error,
    }


def test_engines_are_compared_run_by_run():
    own = [row(1), row(2), row(3, "tilt"), row(4)]
    other = [row(1, error=0.02), row(2, "imu_untrusted"), row(3, "tilt"), row(5)]
    text = "\n".join(agreement.compared(own, other))
    assert "| 1, 0.2 | 3 | 1 | 1 | 1 | 0 | 2.00, 2.00 |" in text
    assert "2 of 3 verdicts are the same" in text
    assert "- 1: ours upright, MuJoCo's imu_untrusted; robots 2" in text


def test_our_calm_floor_is_level_and_nothing_pushes(root):
    settings = agreement.calm(str(root / "config/mbbr.toml"), "full")
    assert "world.full.random_pushes.every_s=0" in settings
    assert "world.full.disturbance.floor_slope_rad=[0,0]" in settings
    assert "world.full.floor.sill_m=0" in settings


def test_friction_on_every_wheel_is_no_motor_fault(tmp_path, monkeypatch):
    """Each of the three lacks half of its torque; together that was more than one motor can do."""
    monkeypatch.setattr(full_world, "DURATION_S", 5.0)
    rows = full_world.Trials(tmp_path, range(8301, 8401)).run("mbbr", "firmware", (0.0, 0.0))
    assert len(rows) == 100
    assert sum("motor_fault" in row["reasons"] for row in rows) <= 2  # 9 with the norm of all


def test_wheels_that_slip_are_no_dead_motor(tmp_path, monkeypatch):
    """A dead one lacks its torque for longer than they do."""
    monkeypatch.setattr(full_world, "DURATION_S", 15.0)
    rows = full_world.Trials(tmp_path, range(18361, 18401)).run("mbbr", "firmware", (2.0, 0.2))
    assert len(rows) == 40
    assert sum("motor_fault" in row["reasons"] for row in rows) <= 1  # 4 by the disturbance of the moment


def test_wheels_that_slip_are_no_push(tmp_path):
    """What was taken for one let the filter follow them."""
    rows = full_world.Trials(tmp_path, range(8401, 8441)).run("mbbr", "nothing judged", (3.0, 0.2))
    assert sum(not row["fell"] for row in rows) >= 24  # 17 when any large innovation was a push


def test_wheels_that_slip_are_no_fault(tmp_path):
    """What a fault's own filter sees slip, too, speaks for none."""
    trials = full_world.Trials(tmp_path, range(8441, 8481))
    rows = [row for yaw_hz in (1.0, 2.0) for row in trials.run("mbbr", "firmware", (yaw_hz, 0.2))]
    assert sum(row["excluded_healthy"] for row in rows) <= 11  # of 80; 16 when that spoke for it


def test_a_slope_speaks_for_no_swapped_axes():
    """An eduMIP that turns on one has its wheels off by a little for seconds."""
    common = {"yaw_hz": 0.5, "drive_mps": 0.3, "duration_s": 14.0, "fidelity": "built2025"}
    asked = [{"robot": robot, "seed": robot, **common} for robot in (15103, 15122, 15145)]
    assert [row["ended"] for row in run_trials("config/edumip.toml", asked)] == ["finished"] * 3


def test_an_edumip_that_turns_fast_is_not_picked_up():
    """Half of a wheel's speed is the turn's: nine of sixty were switched off for it and would have stood."""
    common = {"yaw_hz": 3.0, "drive_mps": 0.2, "duration_s": 20.0, "fidelity": "full"}
    asked = [{"robot": robot, "seed": robot, **common} for robot in (3061, 3076, 3081, 3087, 3097, 3102)]
    assert [row["reasons"] for row in run_trials("config/edumip.toml", asked)] == [[]] * len(asked)


def test_wheels_off_by_a_little_speak_for_no_jump_of_the_bias():
    """Each tick's third of a nat was counted again for seconds: all of these lost their gyro's bias."""
    runs = (2984, 0.5), (2984, 1.0), (2986, 2.0), (2994, 1.0), (2994, 2.0), (3003, 0.5)
    common = {"duration_s": 12.0, "fidelity": "full"}
    asked = [
        {
            "robot": robot,
            "seed": robot,
            "yaw_hz": yaw_hz,
            "drive_mps": 0.3 if yaw_hz == 0.5 else 0.2,
            **common,
        }
        for robot, yaw_hz in runs
    ]
    assert [row["verdicts"] for row in run_trials("config/edumip.toml", asked)] == [[]] * len(runs)


def test_a_bias_that_jumps_takes_gyro_y_with_it(root):
    """y does not tell of it, but what it reads since would be taken for a robot that rolls on and on."""
    command = [
        root / "build/host/equipoise",
        "campaign",
        "--config",
        root / "config/edumip.toml",
        "--json",
        "-",
    ]
    command += ["--robot", "1721", "--robots", "12", "--fidelity", "built2025", "--fault", "bias_jump"]
    command += ["--phase", "balancing", "--phase", "spinning"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    cases = json.loads(done.stdout)["cases"]
    assert len(cases) == 24
    assert sum(case["upright"] for case in cases) >= 18  # 21; 12 where y stays
