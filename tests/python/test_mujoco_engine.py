"""MuJoCo's bodies against our exact dynamics, and the production pipeline on them."""

import json
import subprocess

import numpy as np
import pytest

mujoco = pytest.importorskip(
    "mujoco", reason="mujoco is not installed (tools/test installs tools/requirements-optional.txt)"
)
from equipoise_robot import models  # noqa: E402
from equipoise_robot.engine import Engine  # noqa: E402
from equipoise_tools import mujoco_engine  # noqa: E402

K1 = 0.12  # [T] Table 3.2: torque of a wheel per unit of u


def engine_of(robot, **changes):
    """The typical robot on a level floor, and its inputs and outputs."""
    dimensions = models.dimensions(robot)[1] | changes
    inputs, outputs = np.zeros(7), np.zeros(24)
    engine = Engine(models.mjcf(robot, dimensions), inputs, outputs)
    return engine, inputs, dimensions


def tilted(engine, angle_rad):
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    engine.R_WB[:] = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).ravel()
    engine.start()


def exact(root, tmp_path, robot, row):
    request = tmp_path / "rows.json"
    request.write_text(json.dumps({"rows": [row]}))
    command = [root / "build/host/equipoise", "model", "--robot", robot, "--in", request, "--json", "-"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout)["rows"][0]["qdd"])


@pytest.mark.parametrize("robot", models.ROBOTS)
def test_a_dropped_robot_falls_freely(robot):
    engine, _, dimensions = engine_of(robot)
    tilted(engine, 0.0)
    engine.data.qpos[2] += 1.0
    for _ in range(200):
        engine.step()
    fell = 1.0 - (engine.position[2] - dimensions.get("ball_radius_m", dimensions.get("wheel_radius_m")))
    steps = 200 * dimensions["step_s"]
    assert fell == pytest.approx(0.5 * models.G * steps**2, rel=0.01)
    assert np.abs(engine.force).max() < 1e-6  # an accelerometer feels nothing


@pytest.mark.parametrize("robot", models.ROBOTS)
def test_a_falling_robot_keeps_its_energy(robot):
    engine, _, _ = engine_of(robot)
    engine.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    tilted(engine, 0.05)
    engine.step()
    start = engine.data.energy.copy()
    for _ in range(250):
        engine.step()
    fallen = engine.data.energy - start
    assert fallen[1] > 0.005  # J, of motion
    assert abs(fallen.sum()) < 0.02 * fallen[1]


def test_the_ball_robot_answers_tilt_and_torque_as_the_exact_model(root, tmp_path):
    zero = {"theta_dot": [0.0] * 3, "phi_star_dot": [0.0] * 2}
    engine, inputs, dimensions = engine_of("mbbr")
    h, n = dimensions["step_s"], 5
    for tilt, torque in ((0.1, [0.0, 0.0, 0.0]), (0.0, [0.05, 0.0, 0.0]), (0.0, [0.0, 0.05, 0.0])):
        tilted(engine, tilt)
        engine.data.qvel[:] = 0.0
        inputs[:3] = torque
        for _ in range(n):
            engine.step()
        qdd = exact(root, tmp_path, "mbbr", {"theta_xy": [tilt, 0.0], "tau_B": torque, **zero})
        assert engine.gyro[:2] / (n * h) == pytest.approx(qdd[:2], rel=0.03, abs=0.03)


def test_the_wheeled_robot_answers_tilt_and_torque_as_the_exact_model(root, tmp_path):
    engine, inputs, dimensions = engine_of("mip")
    h, n = dimensions["step_s"], 5
    for tilt, right, left in ((0.1, 0.0, 0.0), (0.0, 0.01, 0.01), (0.0, 0.01, -0.01)):
        tilted(engine, tilt)
        engine.data.qvel[:] = 0.0
        inputs[:2] = right, left
        for _ in range(n):
            engine.step()
        row = {"theta": tilt, "theta_dot": 0.0, "phi_dot": 0.0, "psi_dot": 0.0}
        row |= {"u_x": (right + left) / (2 * K1), "u_z": (right - left) / (2 * K1)}
        qdd = exact(root, tmp_path, "mip", row)
        assert engine.gyro[0] / (n * h) == pytest.approx(qdd[0], rel=0.03, abs=0.03)
        assert engine.gyro[2] / (n * h) == pytest.approx(qdd[2], rel=0.05, abs=0.05)


def test_turning_changes_a_falling_wheeled_robot_as_the_side_force_does(root, tmp_path):
    """Without it the wheel would be driven against the lean: [T] (A.1) to (A.3)."""
    yaw, tilt, n = 12.0, 0.1, 3
    found, expected, without = [], [], []
    for rate in (0.0, yaw):
        engine, _, d = engine_of("mip")
        tilted(engine, tilt)
        engine.data.qvel[:] = 0.0
        engine.data.qvel[3:6] = engine.R_WB.reshape(3, 3).T @ [0.0, 0.0, rate]
        rolls = rate * d["track_m"] / (2 * d["wheel_radius_m"])
        engine.data.qvel[6:8] = rolls, -rolls
        start = engine.data.qvel.copy()
        for _ in range(n):
            engine.step()
        change = (engine.data.qvel - start) / (n * d["step_s"])
        found.append([change[3], change[6:8].mean()])
        row = {"theta": tilt, "theta_dot": 0.0, "phi_dot": 0.0, "psi_dot": rate, "u_x": 0.0, "u_z": 0.0}
        expected.append(exact(root, tmp_path, "mip", {**row, "side_force": True})[:2])
        without.append(exact(root, tmp_path, "mip", row)[:2])
    found, expected, without = (np.subtract(*reversed(rows)) for rows in (found, expected, without))
    assert found == pytest.approx(expected, rel=0.05)
    assert found[1] * without[1] < 0.0


@pytest.mark.parametrize("robot", models.ROBOTS)
def test_a_drag_asks_for_the_lean_of_its_moment_about_the_floor(robot):
    """At the body's centre of mass it would ask for (r + l) / r of that."""
    engine, inputs, d = engine_of(robot)
    tilt, touching = 0.02, (1 if robot == "mbbr" else 2)
    moment = d["body_mass_kg"] * models.G * d["com_height_m"] * np.sin(tilt)
    inputs[:touching], inputs[6] = moment / touching, moment / models.rolling_radius_m(robot, d)
    tilted(engine, tilt)
    for _ in range(20):
        engine.step()
    assert np.abs(engine.gyro).max() < 1e-3
    assert np.abs(engine.joint_rate).max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("config", "yaw_hz", "drive_mps"),
    [("mbbr", 0.0, 0.2), ("mbbr", 1.0, 0.2), ("edumip", 0.0, 0.2), ("edumip", 0.5, 0.0)],
)
def test_both_worlds_agree_on_the_typical_robot(root, config, yaw_hz, drive_mps):
    """Nominal: friction, bridges and sensors, but nothing that the two worlds model each in its own way."""
    import equipoise_robot

    trial = {"robot": 0, "seed": 1, "yaw_hz": yaw_hz, "drive_mps": drive_mps, "duration_s": 20.0}
    trial |= {"fidelity": "nominal", "floor": "calm"}
    path = str(root / f"config/{config}.toml")
    there = mujoco_engine.run(trial, path, [])
    here = equipoise_robot.run(
        path, yaw_hz=yaw_hz, drive_mps=drive_mps, duration_s=20.0, seed=1, fidelity="nominal"
    )
    assert there["ended"] == here.ended == "finished"
    # Within a fifth, or where the errors of both are below a millimetre per second and half a milliradian.
    assert there["yaw_frame_speed_rmse_m_s"] == pytest.approx(
        here.yaw_frame_speed_rmse_m_s, rel=0.2, abs=0.001
    )
    assert there["attitude_rmse_rad"] == pytest.approx(here.attitude_rmse_rad, rel=0.2, abs=0.0005)
    assert there["yaw_rate_mean_hz"] == pytest.approx(yaw_hz, abs=0.01)


@pytest.mark.slow
def test_an_edumip_starts_on_both_wheels(root):
    """One that leans sideways would drop onto its second wheel, which its gyro y takes for a fault."""
    trial = {"seed": 161, "robot": 161, "yaw_hz": 0.0, "drive_mps": 0.2, "duration_s": 5.0, "floor": "calm"}
    row = mujoco_engine.run(trial | {"fidelity": "built2025"}, str(root / "config/edumip.toml"), [])
    assert row["ended"] == "finished"
    assert not row["excluded_healthy"]


@pytest.mark.slow
def test_nothing_pushes_on_a_calm_floor(root):
    """The world's own pushes are off: how strong they would be changes nothing."""
    trial = {"seed": 1, "robot": 1, "yaw_hz": 0.0, "drive_mps": 0.2, "duration_s": 16.0, "floor": "calm"}
    trial["fidelity"] = "full"
    path = str(root / "config/edumip.toml")
    unjudged = "safety.detection=false"
    rows = [
        mujoco_engine.run(trial, path, [f"population.random_pushes.force_N=[{f}, {f}]", unjudged])
        for f in (0.5, 3.0)
    ]
    assert rows[0]["attitude_rmse_rad"] is not None
    assert rows[0]["attitude_rmse_rad"] == rows[1]["attitude_rmse_rad"]


@pytest.mark.slow
@pytest.mark.parametrize("config", ["mbbr", "edumip"])
def test_friction_that_grows_and_missed_ticks_reach_mujoco_too(root, config):
    trial = {"robot": 0, "seed": 1, "yaw_hz": 0.0, "drive_mps": 0.2, "duration_s": 5.0, "floor": "calm"}
    trial["fidelity"] = "nominal"
    world = "world.nominal.disturbance."
    changes = [[], ["friction_scale=[1.5, 1.5]"], ["missed_tick_share=0.05"]]
    rows = [
        mujoco_engine.run(trial, str(root / f"config/{config}.toml"), [world + text for text in change])
        for change in changes
    ]
    assert len({row["attitude_rmse_rad"] for row in rows}) == 3


@pytest.mark.slow
def test_a_twin_shows_what_detection_did(root):
    trial = {"robot": 3, "seed": 3, "yaw_hz": 1.0, "drive_mps": 0.2, "duration_s": 6.0, "floor": "disturbed"}
    trial["fidelity"] = "built2025"
    row = mujoco_engine.judged(trial, str(root / "config/mbbr.toml"), [], twins=True)
    assert {"off_though_it_stands", "saved_by_detector", "excluded_healthy"} <= row.keys()
    assert row["off_though_it_stands"] == (row["ended"] == "disarmed")
    assert (
        mujoco_engine.judged(trial, str(root / "config/mbbr.toml"), [], twins=False)["saved_by_detector"]
        is None
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("config", "floor", "robots"),
    [("mbbr", "disturbed", (890, 896, 909, 912, 923, 932)), ("edumip", "calm", (1204,))],
)
def test_what_shows_slowly_is_neither_jump_nor_swap(root, config, floor, robots):
    """Most of these drives lost a gyro bias or axis to a suspicion that had grown for seconds."""
    trial = {"yaw_hz": 0.0, "drive_mps": 0.2, "duration_s": 30.0, "floor": floor, "fidelity": "built2025"}
    for robot in robots:
        row = mujoco_engine.run(
            trial | {"robot": robot, "seed": robot}, str(root / f"config/{config}.toml"), []
        )
        assert row["verdicts"] == [] and not row["fell"]


@pytest.mark.slow
def test_edumips_that_rock_keep_their_gyro(root):
    """Pushed aside or over sills; which one loses its gyro yet differs between machines."""
    trial = {
        "yaw_hz": 0.0,
        "drive_mps": 0.0,
        "duration_s": 10.0,
        "floor": "disturbed",
        "fidelity": "built2025",
    }
    rows = [
        mujoco_engine.run(trial | {"seed": robot, "robot": robot}, str(root / "config/edumip.toml"), [])
        for robot in range(1201, 1213)
    ]
    assert sum(row["excluded_healthy"] for row in rows) <= 4  # 55 of 70 before one knew that it rocks


def environment(robot, **options):
    gymnasium = pytest.importorskip("gymnasium")
    name = f"equipoise_robot:Equipoise-{robot.capitalize()}-v0"
    return gymnasium.make(name, **{"engine": "mujoco"} | options)


@pytest.mark.parametrize("robot", models.ROBOTS)
def test_an_environment_on_mujoco_passes_gymnasiums_check(robot):
    from gymnasium.utils.env_checker import check_env

    env = environment(robot)
    check_env(env.unwrapped)
    first, again = env.reset(seed=3)[0], env.reset(seed=3)[0]
    np.testing.assert_array_equal(first, again)
    assert (env.reset(seed=4)[0] != first).any()


@pytest.mark.parametrize("engine", ["own", "mujoco"])
@pytest.mark.parametrize("robot", models.ROBOTS)
def test_a_policy_crosses_engines(root, robot, engine):
    """LQR by the design's gains: upright for 3 s in both, and without it in neither."""
    from equipoise_robot.envs import BalanceVectorEnv
    from equipoise_tools.speed import standing_policy

    envs = BalanceVectorEnv(robot, num_envs=2, engine=engine)
    gains = standing_policy(root, robot, envs.observation_names)
    observation, _ = envs.reset(seed=1)
    for _ in range(600):
        observation, _, lost, _, _ = envs.step(observation @ gains.T)
        assert not lost.any()
    for _ in range(300):
        *_, lost, _, _ = envs.step(np.zeros((2, gains.shape[0])))
        if lost.any():
            break
    assert lost.any()


@pytest.mark.parametrize("robot", models.ROBOTS)
def test_observations_of_both_engines_have_the_same_names_units_and_signs(robot):
    """Each wheel is driven alone for 0.1 s: every column goes the same way, and as far."""
    own, other = environment(robot, engine="own"), environment(robot)
    names = own.unwrapped.observation_names
    assert names == other.unwrapped.observation_names
    assert own.observation_space == other.observation_space and own.action_space == other.action_space
    gone = []
    for env in (own, other):
        for action in 0.3 * np.eye(own.action_space.shape[0]):
            start, _ = env.reset(seed=3)
            gone.append([env.step(action)[0] - start for _ in range(20)])
    here, there = np.array_split(np.array(gone), 2)  # wheel, step, column
    reach, apart = np.abs(here).max(axis=(0, 1)), np.abs(there - here).max(axis=(0, 1))
    for name, far, off in zip(names, reach, apart, strict=True):
        assert off <= 0.1 * far, f"{name}: {off:.4f} apart in {far:.4f}"
        assert far > 0.005 or name.startswith("reference"), name


def test_a_floor_that_holds_holds_a_ball_that_is_spun_up():
    """Nominal, all wheels: the body turns against a ball that stays, 15 rad/s in 0.1 s."""
    rates = []
    for engine in ("own", "mujoco"):
        env = environment("mbbr", engine=engine)
        env.reset(seed=3)
        for _ in range(20):
            observation, *_ = env.step(np.full(3, 0.3))
        rates.append(observation[env.unwrapped.observation_names.index("yaw_rate")])
    assert rates[0] > 10.0 and rates[1] == pytest.approx(rates[0], rel=0.05)


def test_the_environments_bodies_are_mujocos(monkeypatch):
    """What the engine raises ends the step and is raised; the next reset begins anew."""
    from equipoise_robot import UserError, engine
    from equipoise_robot.envs import BalanceEnv

    env = environment("mbbr")
    env.reset(seed=1)
    rest = np.zeros(3)
    env.step(rest)
    monkeypatch.setattr(engine.Engine, "read", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        env.step(rest)
    monkeypatch.undo()
    env.reset(seed=1)
    env.step(rest)
    with pytest.raises(UserError, match="engine: 'bullet' is none; they are own, mujoco"):
        BalanceEnv("mbbr", engine="bullet")
