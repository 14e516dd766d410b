"""The example client with MuJoCo behind lockstep: its robot is the model's, and the firmware balances it."""

import json
import subprocess

import numpy as np
import pytest

pytest.importorskip(
    "mujoco", reason="mujoco is not installed (tools/test installs tools/requirements-optional.txt)"
)
from equipoise_tools import mujoco_client

PLAIN = ["--set", "motor.bridge=drive_brake", "--set", "friction.compensation=0.0"]


def test_the_engines_robot_falls_and_spins_as_the_model_says(root, tmp_path):
    robot = mujoco_client.Robot(tilt_rad=0.1)
    robot.held = False
    start = robot.tilt_rad()
    duty = np.array([0.3, 0.3, 0.3])
    # The model's ball does not turn under the wheels; a contact of 5 mm holds a tenth of this torque.
    spun = mujoco_client.Robot(tilt_rad=0.0, torsion_radius_m=0.5)
    robot.advance(np.zeros(3), True)
    spun.advance(duty, True)
    rows = [
        {"theta_xy": [0.1, 0.0], "theta_dot": [0.0] * 3, "phi_star_dot": [0.0] * 2, "tau_B": [0.0] * 3},
        {
            "theta_xy": [0.0, 0.0],
            "theta_dot": [0.0] * 3,
            "phi_star_dot": [0.0] * 2,
            "tau_B": (mujoco_client.K1 * 2.56 * mujoco_client.WHEEL_AXES @ duty).tolist(),
        },
    ]
    request = tmp_path / "rows.json"
    request.write_text(json.dumps({"rows": rows}))
    command = [root / "build/host/equipoise", "model", "--robot", "mbbr", "--in", request, "--json", "-"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    tilting, turning = (row["qdd"] for row in json.loads(done.stdout)["rows"])
    half_square = 0.5 * mujoco_client.DT**2
    assert robot.tilt_rad() - start == pytest.approx(tilting[0] * half_square, rel=0.15)
    # Back-EMF takes three per cent within the tick, the wheels' inertia one and a half.
    assert spun.yaw_rate_rad_s() == pytest.approx(turning[2] * mujoco_client.DT, rel=0.10)


def test_the_gyro_is_late_and_the_encoders_are_not():
    robot = mujoco_client.Robot(tilt_rad=0.0)
    robot.rng = np.random.default_rng(0)
    quiet = type("Quiet", (), {"normal": lambda self, size: np.zeros(size)})()
    robot.rng = quiet
    before = 0.0
    for _ in range(6):
        before = robot.yaw_rate_rad_s()
        robot.advance(np.array([0.5, 0.5, 0.5]), True)
    now = robot.yaw_rate_rad_s()
    message = robot.sensors(6)
    expected = now + mujoco_client.GYRO_DELAY_S / mujoco_client.DT * (before - now)
    assert message.gyro_B_rad_s[2] == pytest.approx(expected, rel=0.02)
    assert list(message.wheel_angle_rad[:3]) == pytest.approx(robot.wheels.tolist())


def balanced(root, tmp_path, robot, duration_s, *arguments):
    path = tmp_path / "io.sock"
    command = [root / "build/host/equipoise", "run", "--config", root / "config/mbbr.toml"]
    command += ["--backend", "lockstep", "--socket", path, "--log", "off", "--telemetry", "off"]
    command += [*PLAIN, *arguments, "--timeout-s", "60"]
    firmware = subprocess.Popen(
        list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    result = mujoco_client.balance(str(path), duration_s, robot)
    _, err = firmware.communicate(timeout=120)
    assert firmware.returncode == 0, err
    assert result["ended"] == "finished"
    assert result["upright"]
    return result


@pytest.mark.slow
@pytest.mark.parametrize(("yaw_hz", "drive_mps"), [(0.0, 0.2), (1.0, 0.2), (1.5, 0.2), (3.0, 0.1)])
def test_the_defaults_balance_spin_and_drive_it(root, tmp_path, yaw_hz, drive_mps):
    """With the board's IMU delay, [T]'s noise, a floor of grip 0.6 and a contact of 5 mm."""
    asked = ["--yaw-hz", yaw_hz, "--drive-mps", drive_mps]
    result = balanced(root, tmp_path, mujoco_client.Robot(), 30.0, *asked)
    assert result["yaw_hz"] == pytest.approx(yaw_hz, abs=0.02)
    assert result["speed_m_s"] == pytest.approx(drive_mps, abs=0.02)


@pytest.mark.slow
def test_the_printed_feedback_balances_it(root, tmp_path):
    balanced(root, tmp_path, mujoco_client.Robot(), 5.0, "--controller", "thesis", "--estimator", "ekf13")
