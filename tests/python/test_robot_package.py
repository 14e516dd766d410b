"""equipoise_robot in the tree: the command's numbers, own functions, sweeps, logs, environments."""

import json
import runpy
import subprocess
import sys

import equipoise_robot as eq
import numpy as np
import pytest
from equipoise_robot import UserError, channels
from equipoise_tools.speed import standing_policy

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")

ROBOTS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml"}
WALL_CLOCK = {"real_time_factor"}


def command(root, *arguments) -> dict:
    ran = subprocess.run(
        [root / "build/host/equipoise", *map(str, arguments), "--json", "-"],
        capture_output=True,
        text=True,
        cwd=root,
        check=False,
    )
    assert ran.returncode in (0, 1), ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize("robot", ROBOTS)
def test_run_gives_the_numbers_of_the_command(root, robot):
    asked = {"yaw_hz": 0.5, "drive_mps": 0.1, "duration_s": 6.0, "seed": 7, "fidelity": "built2025"}
    options = [word for key, value in asked.items() for word in (f"--{key.replace('_', '-')}", value)]
    options += ["--robot", 3, "--set", "friction.compensation=0.9", "--compare", "--log", "off"]
    said = command(root, "sim", "--config", ROBOTS[robot], *options, "--telemetry", "off")
    result = eq.run(robot, **asked, robot_number=3, set={"friction.compensation": 0.9}, compare=True)
    assert set(result.to_dict()) == set(said) - {"log"}
    assert {k: v for k, v in result.to_dict().items() if k not in WALL_CLOCK} == {
        k: v for k, v in said.items() if k not in WALL_CLOCK | {"log"}
    }
    assert result.position_rmse_m == said["position_rmse_m"] is not None


@pytest.mark.parametrize("robot", ROBOTS)
def test_design_gives_the_numbers_of_the_command(root, robot):
    said = command(root, "design", "--config", ROBOTS[robot], "--last-hz", 1, "--step-hz", 1)
    assert eq.design(robot, last_hz=1.0, step_hz=1.0).to_dict() == said


@pytest.mark.parametrize("robot", ROBOTS)
def test_own_functions_that_hand_on_what_they_get_change_nothing(robot):
    asked = {"drive_mps": 0.1, "duration_s": 6.0}
    plain = eq.run(robot, **asked).to_dict()
    controlled = eq.run(robot, controller=lambda tick: tick.u_own, **asked).to_dict()
    assert {k for k, v in plain.items() if controlled[k] != v} <= WALL_CLOCK | {"controller"}
    assert controlled["controller"] == "<lambda>"
    estimated = eq.run(robot, estimator=lambda tick: tick.own, **asked).to_dict()
    assert {k for k, v in plain.items() if estimated[k] != v} <= WALL_CLOCK | {"estimator"}


def test_an_own_controller_balances_the_robot_and_one_that_does_nothing_lets_it_fall():
    assert eq.run("mip", controller=lambda tick: [0.0, 0.0], duration_s=3.0).fell
    seen = []

    def watching(tick):
        seen.append((tick.t_s, tick.error, tick.reference.phi_rad - tick.estimate.phi_rad))
        return tick.u_own

    eq.run("mip", controller=watching, duration_s=2.0, drive_mps=0.2)
    assert len(seen) == 400
    assert seen[-1][0] == pytest.approx(2.0)
    assert seen[-1][1][2] == pytest.approx(seen[-1][2][0])  # error "phi" is reference minus estimate
    assert eq.error_names("mip")[2] == "phi"


def test_an_own_estimator_is_what_controls():
    def lying(tick):
        tick.own.theta_rad[0] += 0.05
        return tick.own

    honest = eq.run("mip", duration_s=8.0)
    assert eq.run("mip", estimator=lying, duration_s=8.0).attitude_rmse_rad == pytest.approx(
        0.05, abs=honest.attitude_rmse_rad + 1e-3
    )


def test_what_an_own_function_raises_ends_the_run_and_is_raised():
    ticks = []

    def broken(tick):
        ticks.append(tick.t_s)
        if len(ticks) == 10:
            raise RuntimeError("as planned")
        return tick.u_own

    with pytest.raises(RuntimeError, match="as planned"):
        eq.run("mbbr", controller=broken, duration_s=5.0)
    assert len(ticks) == 10
    with pytest.raises(UserError, match="returned 1 numbers; this robot has 3 inputs"):
        eq.run("mbbr", controller=lambda tick: [0.0], duration_s=1.0)
    with pytest.raises(UserError, match="returned no State"):
        eq.run("mbbr", estimator=lambda tick: None, duration_s=1.0)


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        ({"robot": "segway"}, "segway: no such configuration file.*mbbr, mip"),
        ({"yaw_hz": 6.0}, "yaw_hz: 6.* out of range; allowed: -5.0 to 5.0"),
        ({"duration_s": 0.0}, "duration_s: 0.0 is out of range"),
        ({"drive_mps": float("nan")}, "drive_mps"),
        ({"estimator": "ekf14"}, "ekf14: not known to mbbr; allowed: ekf, "),
        ({"fidelity": "perfect"}, "perfect"),
        ({"attitude": "sun"}, "allowed: dmp, own"),
        ({"set": {"friction.compensatoin": 1}}, "friction.compensatoin"),
        ({"set": "friction.compensation=1"}, "a dictionary or a list"),
    ],
)
def test_wrong_input_is_a_clear_error(asked, complaint):
    with pytest.raises(UserError, match=complaint):
        eq.run(**{"duration_s": 1.0} | asked)


def test_a_recorded_run_is_what_the_log_has(root, tmp_path):
    file = tmp_path / "run.lcm"
    options = ["--duration-s", 2, "--seed", 5, "--compare", "--telemetry", "off", "--log", file]
    command(root, "sim", "--config", ROBOTS["mbbr"], *options)
    written = eq.Log(file)
    recorded = eq.run("mbbr", duration_s=2.0, seed=5, compare=True, record=True).log
    assert set(written) - {"EQUIPOISE_VERDICT"} == set(recorded)  # the run's own attributes say how it ended
    for channel in set(recorded) - {channels.RUN, channels.TIMING}:
        for name in written[channel].dtype.names:
            np.testing.assert_array_equal(
                written[channel][name], recorded[channel][name], err_msg=f"{channel}.{name}"
            )
    assert written.run.config_toml == recorded.run.config_toml
    np.testing.assert_array_equal(written.sensors(), recorded.sensors())


def test_sensors_are_calibrated_as_in_the_run():
    """A robot at rest feels gravity; its wheels' angles are counts over counts per turn."""
    turned = "calibration.R_BS=[0, -1, 0, 1, 0, 0, 0, 0, 1]"
    log = eq.run("mip", duration_s=3.0, record=True, fidelity="ideal", set=[turned]).log
    z, raw = log.sensors(), log[channels.SENSORS]
    assert z["t_s"][-1] == pytest.approx(3.0, abs=2e-6)
    held = z["t_s"] < 0.5
    np.testing.assert_allclose(z["accel_B_m_s2"][held].mean(axis=0)[2], -9.8, atol=0.1)
    per_turn = float(log.run.config_toml.split("encoder_counts_per_rev = ")[1].split()[0])
    per_count = 2 * np.pi / per_turn
    np.testing.assert_allclose(np.abs(z["wheel_angle_rad"]), np.abs(raw["encoder_counts"][:, :2] * per_count))
    gyro_x, raw_y = z["gyro_B_rad_s"][:, 0], raw["gyro_counts"][:, 1]
    assert np.corrcoef(gyro_x, raw_y)[0, 1] < -0.99  # turned as R_BS says
    for start, stop in ((100, 103), (7, 8), (7, 7)):
        np.testing.assert_array_equal(log.sensors(start, stop), z[start:stop])
    np.testing.assert_array_equal(log.sensors(10, every=7), z[10::7])


def test_tables_of_a_log():
    log = eq.run("mbbr", duration_s=1.0, record=True).log
    table = log.to_pandas()
    assert len(table) == 200
    assert table.index.name == "t_s"
    assert table.index[-1] == pytest.approx(1.0, abs=2e-6)
    np.testing.assert_array_equal(table["theta_rad[1]"], log[channels.STATE]["theta_rad"][:, 1])
    assert len(log.to_pandas("sensors", every=50)) == 4
    assert log.to_pandas(channels.RUN)["robot"].tolist() == ["mbbr"]
    with pytest.raises(UserError, match="EQUIPOISE_STAT: is no channel of this log; it has sensors, "):
        log.to_pandas("EQUIPOISE_STAT")


def test_a_sweep_is_the_runs_one_by_one():
    over = {"drive_mps": [0.0, 0.1], "seed": [1, 2]}
    table = eq.sweep("mip", over, jobs=2, duration_s=6.0, progress=False)
    assert table[["drive_mps", "seed"]].to_numpy().tolist() == [[0.0, 1], [0.0, 2], [0.1, 1], [0.1, 2]]
    alone = eq.run("mip", drive_mps=0.1, seed=1, duration_s=6.0)
    assert table["position_rmse_m"][2] == alone.position_rmse_m
    assert (table["ran_s"] == 6.0).all()
    with pytest.raises(UserError, match="nothing to vary"):
        eq.sweep("mip", {})


def test_a_sweep_without_pandas_says_what_to_install():
    program = """
import sys
sys.modules["pandas"] = None
import equipoise_robot
equipoise_robot.sweep("mip", {"seed": [1]})
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "pandas is not installed; in a clone: pip install '.[pandas]'" in ran.stderr


@pytest.mark.parametrize("name", ["Mbbr", "Mip"])
def test_environments_pass_gymnasiums_check(name):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make(f"equipoise_robot.envs:Equipoise-{name}-v0")
    check_env(env.unwrapped)
    first, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    np.testing.assert_array_equal(first, again)
    other, _ = env.reset(seed=4)
    assert (other != first).any()


def test_a_policy_keeps_the_robot_up_and_none_lets_it_fall(root):
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make("equipoise_robot.envs:Equipoise-Mip-v0", max_episode_steps=600)
    gains = standing_policy(root, "mip", env.unwrapped.observation_names)

    def policy(observation):
        return np.clip(gains @ observation, -1.0, 1.0)

    def steps_of(act):
        observation, _ = env.reset(seed=1)
        rewards = []
        while True:
            observation, reward, lost, out_of_time, _ = env.step(act(observation))
            rewards.append(reward)
            if lost or out_of_time:
                return rewards, lost

    rewards, lost = steps_of(policy)
    assert not lost
    assert len(rewards) == 600
    assert np.mean(rewards) > 0.9
    rewards, lost = steps_of(lambda observation: np.zeros(2))
    assert lost
    assert len(rewards) < 300
    assert rewards[-1] == 0.0
    assert abs(env.unwrapped.truth.theta_rad[0]) > 0.05


def test_actions_are_limited_and_the_reward_is_1_less_squared_errors_and_drive():
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make("equipoise_robot.envs:Equipoise-Mbbr-v0").unwrapped
    env.reset(seed=2)
    for drive in ([0.1, -0.2, 0.3], [2.0, -0.3, 0.1]):
        observation, reward, lost, _, _ = env.step(np.array(drive))
        error = dict(zip(env.observation_names, observation, strict=True))
        costs = [
            (error[f"theta_{axis}"] / 0.1) ** 2 + (error[f"phi_dot_{axis}"] / 10.0) ** 2 for axis in "xy"
        ]
        cost = sum(costs) + (error["yaw_rate"] / 5.0) ** 2 + 0.05 * sum(min(d, 1.0) ** 2 for d in drive)
        assert not lost
        assert 0.0 < cost < 1.0
        assert reward == pytest.approx(1.0 - cost, abs=1e-12)
    states = []
    for largest in (1.0, 7.0):
        env.reset(seed=2)
        states.append([env.step(np.array([largest, -largest, 0.0]))[0] for _ in range(3)])
    np.testing.assert_array_equal(*states)


def test_vectorised_steps_are_the_single_ones():
    gymnasium = pytest.importorskip("gymnasium")
    envs = gymnasium.make_vec("equipoise_robot.envs:Equipoise-Mip-v0", num_envs=3, max_episode_steps=50)
    single = gymnasium.make("equipoise_robot.envs:Equipoise-Mip-v0").unwrapped
    envs.reset(seed=[5, 6, 7])
    action = np.full((3, 2), 0.02)
    together = [envs.step(action) for _ in range(50)]
    again = envs.step(action)  # out of time: reset
    assert together[-1][3].all()
    assert (again[1] == 0).all()
    assert not (again[2] | again[3]).any()
    for i, seed in enumerate((5, 6, 7)):
        single.reset(seed=seed)
        alone = [single.step(action[i]) for _ in range(50)]
        np.testing.assert_array_equal(together[9][0][i], alone[9][0])
        assert together[9][1][i] == alone[9][1]
        np.testing.assert_array_equal(again[0][i], single.reset()[0])


@pytest.mark.parametrize("robot", ["mip", "mbbr"])
def test_the_policy_that_speed_is_measured_with_keeps_all_robots_up(root, robot):
    envs_module = pytest.importorskip("equipoise_robot.envs")
    envs = envs_module.BalanceVectorEnv(robot, num_envs=4)
    gains = standing_policy(root, robot, envs.observation_names)
    observation, _ = envs.reset(seed=1)
    for _ in range(600):
        observation, _, lost, _, _ = envs.step(observation @ gains.T)
        assert not lost.any()


@pytest.mark.parametrize("jobs", [1, 3])
def test_the_number_of_threads_changes_nothing(jobs):
    envs_module = pytest.importorskip("equipoise_robot.envs")

    def observed(threads):
        envs = envs_module.BalanceVectorEnv(
            "mip", num_envs=5, max_episode_steps=30, fidelity="built2025", population=(1, 50), jobs=threads
        )
        first, _ = envs.reset(seed=9)
        steps = [envs.step(np.full((5, 2), 0.02))[0] for _ in range(70)]  # each is reset twice
        return np.array([first, *steps])

    np.testing.assert_array_equal(observed(jobs), observed(2))


def test_a_robot_that_cannot_be_drawn_is_named_from_whatever_thread():
    envs_module = pytest.importorskip("equipoise_robot.envs")
    envs = envs_module.BalanceVectorEnv("mip", num_envs=4, population=(-9, -9), fidelity="built2025", jobs=2)
    with pytest.raises(eq.UserError, match="robot_number"):
        envs.reset(seed=1)


def test_example_that_measures_environments(root, capsys, monkeypatch):
    pytest.importorskip("gymnasium")
    monkeypatch.setattr(sys, "argv", ["environment_speed.py", "1"])
    runpy.run_path(str(root / "examples" / "environment_speed.py"), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" robots")[0] for line in lines] == ["Mbbr, 1", "Mbbr, 16", "Mip, 1", "Mip, 16"]
    assert all(int(line.split("robots: ")[1].split()[0]) > 0 for line in lines)


@pytest.mark.parametrize(
    ("example", "better_than_m_or_mrad"), [("own_controller", 0.15), ("own_estimator", 12.0)]
)
def test_examples_run(root, capsys, example, better_than_m_or_mrad):
    assert len((root / "examples" / f"{example}.py").read_text().splitlines()) <= 40
    runpy.run_path(str(root / "examples" / f"{example}.py"), run_name="__main__")
    own = capsys.readouterr().out.splitlines()[-1]
    assert "finished" in own
    assert float(own.split("error ")[1].split()[0]) < better_than_m_or_mrad
