"""MuJoCo's bodies against our exact dynamics, and the production pipeline on them."""

import json
import subprocess

import numpy as np
import pytest

mujoco = pytest.importorskip(
    "mujoco", reason="mujoco is not installed (tools/test installs tools/requirements-optional.txt)"
)
from equipoise_robot import _core  # noqa: E402
from equipoise_tools import mjcf, mujoco_engine  # noqa: E402

K1 = 0.12  # [T] Table 3.2: torque of a wheel per unit of u


def engine_of(robot, **changes):
    """The typical robot on a level floor, and its inputs and outputs."""
    request = _core.Request()
    request.config = str(mjcf.repository_root() / mjcf.FILES[robot][0])
    dimensions = json.loads(_core.dimensions(request)) | changes
    inputs, outputs = np.zeros(7), np.zeros(24)
    engine = mujoco_engine.Engine(mjcf.BY_TYPE[robot](dimensions, mjcf.Floor()), inputs, outputs)
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


@pytest.mark.parametrize("robot", mjcf.FILES)
def test_the_committed_model_is_the_configured_robot(root, robot):
    assert (root / mjcf.FILES[robot][1]).read_text() == mjcf.typical(
        robot
    ), "run python -m equipoise_tools.mjcf"


@pytest.mark.parametrize("robot", mjcf.FILES)
def test_a_dropped_robot_falls_freely(robot):
    engine, _, dimensions = engine_of(robot)
    tilted(engine, 0.0)
    engine.data.qpos[2] += 1.0
    for _ in range(200):
        engine.step()
    fell = 1.0 - (engine.position[2] - dimensions.get("ball_radius_m", dimensions.get("wheel_radius_m")))
    steps = 200 * dimensions["step_s"]
    assert fell == pytest.approx(0.5 * mjcf.G * steps**2, rel=0.01)
    assert np.abs(engine.force).max() < 1e-6  # an accelerometer feels nothing


@pytest.mark.parametrize("robot", mjcf.FILES)
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
