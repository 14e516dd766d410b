"""Robots that a configuration can say and the firmware cannot run are refused with the reason."""

import subprocess

import pytest


def simulated(root, robot, *arguments):
    command = [root / "build/host/equipoise", "sim", "--config", root / f"config/{robot}.toml"]
    command += ["--duration-s", "6", "--log", "off", "--json", "-", *arguments]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=120)


def put(*settings):
    return [word for setting in settings for word in ("--set", setting)]


@pytest.mark.parametrize(
    ("robot", "arguments", "complaint"),
    [
        ("edumip", put("controller.slc.design.gain_U=3"), "controller.slc.design: implausible: phase margin"),
        ("edumip", put("controller.slc.design.gain_U=0.5"), "no gain stabilises this robot"),
        ("edumip", [*put("robot.k2_N_m_s=0.05"), "--controller", "lqr"], "fastest mode of the model"),
        (
            "mbbr",
            put("robot.k2_ball_N_m_s=0.1", "robot.k1_N_m=0.5", "motor.resistance_ohm=1.2"),
            "fastest mode of the model",
        ),
        ("edumip", put("robot.coulomb_friction_N_m=0.12"), "no command would move the robot"),
        ("mbbr", put("reference.duty_share=0.05"), "no command would move the robot"),
    ],
)
def test_is_refused(root, robot, arguments, complaint):
    done = simulated(root, robot, *arguments)
    assert done.returncode == 2 and complaint in done.stderr, done.stderr


def test_successive_loop_closure_is_not_asked_of_who_chooses_the_other(root):
    done = simulated(root, "edumip", *put("controller.slc.design.gain_U=0.5"), "--controller", "lqr")
    assert done.returncode == 0, done.stderr


def test_without_back_emf_commands_are_followed(root):
    settings = put("robot.k2_N_m_s=0", "robot.viscous_friction_N_m_s=0")
    done = simulated(root, "edumip", *settings, "--controller", "lqr", "--drive-mps", "0.1")
    assert done.returncode == 0 and "duty" in done.stdout
