"""Other people's robots by configuration alone: each one's simulated twin stands, drives and turns."""

import json
import subprocess

import numpy as np
import pytest
from equipoise_tools.foreign_log import geometry
from equipoise_tools.paths import binary, repository_root

CONFIGS = [
    *sorted((repository_root() / "config/real").glob("*.toml")),
    repository_root() / "config/kugle.toml",
]
SLOW = {"openballbot": 0.15}  # its torque limit and damping leave 0.2 m/s no room to turn


@pytest.mark.parametrize("config", CONFIGS, ids=lambda path: path.stem)
def test_the_twin_of_a_foreign_robot_stands_drives_and_turns(config):
    speed = SLOW.get(config.stem, 0.2)
    command = [
        binary(),
        "sim",
        "--config",
        config,
        "--fidelity",
        "nominal",
        "--duration-s",
        12,
        "--json",
        "-",
    ]
    command += ["--drive-mps", speed, "--yaw-hz", 0.05, "--telemetry", "off", "--log", "off"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["ended"] == "finished" and result["duty_max"] > 0.01
    assert result["yaw_rate_mean_hz"] == pytest.approx(0.05, rel=0.1)
    assert result["yaw_frame_speed_rmse_m_s"] < 0.1 * speed


@pytest.mark.parametrize(
    ("order", "turned_deg", "named"),
    [
        ((0, 1, 2), 0.0, ""),
        ((1, 0, 2), 0.0, "wheels 2, 1, 3"),
        ((0, 1, 2), 45.0, "azimuth_deg is off: add 45"),
    ],
)
def test_a_models_axes_tell_a_wrong_order_or_azimuth(order, turned_deg, named):
    robot = {"wheel_latitude_deg": 45.0, "wheel_azimuth_deg": 77.5, "wheel_tilt_deg": 0.0}
    model = robot | {"wheel_azimuth_deg": 77.5 + turned_deg}
    axes = np.array(geometry(model)["T_ob"])[:, order]
    mistake = geometry(robot, axes)["mistake"]
    assert named in mistake and bool(mistake) == bool(named)
