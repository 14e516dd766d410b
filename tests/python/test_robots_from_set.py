"""Robots of other sizes from --set alone: gains and filter follow the configuration."""

import json
import random
import subprocess
import tomllib

import pytest

NOMINAL = "nominal"


def simulate(root, robot, settings, *arguments):
    overrides = [f"--set={key}={json.dumps(value)}" for key, value in settings.items()]
    command = [root / "build/host/equipoise", "sim", "--config", root / f"config/{robot}.toml", *overrides]
    options = ["--json", "-", "--log", "off", "--telemetry", "off", "--duration-s", "30"]
    run = subprocess.run([*command, *options, *arguments], capture_output=True, text=True, check=False)
    assert run.returncode in (0, 1), run.stderr
    return json.loads(run.stdout)


def scaled(base, mass, height, wheel_m):
    """What follows from size: inertia as mass x height^2, about the vertical as mass;
    back-EMF and the wheels' inertia about the ball as the square of the radius ratio."""
    ratio = (base["wheel_radius_m"] / wheel_m) ** 2
    x, y, z = base["body_inertia_kg_m2"]
    return {
        "robot.body_mass_kg": mass * base["body_mass_kg"],
        "robot.com_height_m": height * base["com_height_m"],
        "robot.body_inertia_kg_m2": [mass * height**2 * x, mass * height**2 * y, mass * z],
        "robot.imu_position_m": [0.0, 0.0, height * base["imu_position_m"][2]],
        "robot.wheel_radius_m": wheel_m,
        "robot.k2_ball_N_m_s": ratio * base["k2_ball_N_m_s"],
        "robot.wheel_inertia_about_ball_kg_m2": ratio * base["wheel_inertia_about_ball_kg_m2"],
        "safety.encoder_check_drive": 0.0,  # knows the shipped wheels only: it calls slower ones stuck
    }


@pytest.fixture(scope="module")
def table_5_2(root):
    return tomllib.loads((root / "config/mbbr.toml").read_text(encoding="utf-8"))["robot"]


@pytest.mark.parametrize("draw", range(20))
def test_other_robots_balance_turn_and_drive(root, table_5_2, draw):
    """0.3 to 3 x the mass, 0.6 to 2 x the height, wheels of 10 to 25 mm."""
    chance = random.Random(draw)
    size = (chance.uniform(0.3, 3.0), chance.uniform(0.6, 2.0), chance.uniform(0.010, 0.025))
    settings = scaled(table_5_2, *size)
    for motion in ([], ["--yaw-hz", "0.5", "--drive-mps", "0.1"]):
        result = simulate(root, "mbbr", settings, "--fidelity", NOMINAL, *motion)
        assert not result["fell"], f"mass, height, wheel {size}: {result}"


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("robot.com_height_m=1.0", "robot.com_height_m: implausible"),
        ("robot.k1_N_m=0.02", "robot.k1_N_m: implausible"),
        ("robot.ball_inertia_kg_m2=8.46e-3", "robot.ball_inertia_kg_m2: implausible"),
        ("controller.scheduled.design.theta_rad=0.0005", "controller.scheduled.design: implausible"),
    ],
)
def test_a_design_without_margin_is_refused_and_named(root, setting, named):
    command = [root / "build/host/equipoise", "sim", "--config", root / "config/mbbr.toml", "--set", setting]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert named in run.stderr


def test_a_ball_bot_of_kugles_size_balances_and_drives(root):
    for motion in ([], ["--drive-mps", "0.3"], ["--yaw-hz", "0.25", "--drive-mps", "0.2"]):
        for seed in range(1, 6):
            result = simulate(root, "kugle", {}, "--fidelity", NOMINAL, "--seed", str(seed), *motion)
            assert not result["fell"], result
            assert result["position_rmse_m"] < 1.0
        assert not simulate(root, "kugle", {}, "--fidelity", "full", *motion)["fell"]
