"""Other people's models in MuJoCo by a configuration alone; wrong wheels are named before arming."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip(
    "mujoco", reason="mujoco is not installed (tools/test installs tools/requirements-optional.txt)"
)
from equipoise_tools import foreign_model
from equipoise_tools.foreign_log import configuration, geometry

OWN = """
robot = "{root}/config/edumip.toml"
base = "robot"
axes = ["x", "y", "z"]
wheels = {wheels}
"""


def drive(model, map_file, *arguments):
    command = [sys.executable, "-m", "equipoise_tools.foreign_model", model, "--map", map_file, "--json"]
    done = subprocess.run(
        [*map(str, command), *map(str, arguments)], capture_output=True, text=True, check=False
    )
    return done, json.loads(done.stdout) if done.stdout else {}


def own(root, tmp_path, wheels='["right", "left"]'):
    path = tmp_path / "own.toml"
    path.write_text(OWN.format(root=root, wheels=wheels))
    return path


@pytest.mark.parametrize(("drive_mps", "yaw_hz"), [(0.2, 0.0), (0.0, 0.25)])
def test_our_own_model_drives_and_turns(root, tmp_path, drive_mps, yaw_hz):
    given = ("--drive-mps", drive_mps, "--yaw-hz", yaw_hz, "--duration-s", 12)
    done, result = drive(root / "models/edumip.xml", own(root, tmp_path), *given)
    assert done.returncode == 0, done.stderr
    assert result["yaw_hz"] == pytest.approx(yaw_hz, abs=0.01)
    assert result["speed_m_s"] == pytest.approx(drive_mps, rel=0.02, abs=0.004)


@pytest.mark.parametrize(
    ("wheels", "named"),
    [
        ('["left", "right"]', "order is exchanged"),
        ('["right", "-left"]', "sign of wheel 2 is flipped"),
        ('["right", "rear"]', "has no joint rear"),
    ],
)
def test_a_two_wheelers_wrong_wheels_are_named_before_arming(root, tmp_path, wheels, named):
    done, _ = drive(root / "models/edumip.xml", own(root, tmp_path, wheels))
    assert done.returncode == 2 and named in done.stderr


BALL_BOT = """<mujoco><worldbody><geom type="plane" size="5 5 1"/>
<body name="base" pos="0 0 0.3"><freejoint/><geom type="sphere" size="0.05" pos="0 0 0.1"/>{wheels}</body>
<body name="ball" pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("order", "signs", "turned_deg", "named"),
    [
        ((0, 1, 2), "   ", 0.0, ""),
        ((1, 0, 2), "   ", 0.0, "wheels 2, 1, 3"),
        ((0, 1, 2), " - ", 0.0, "sign of column 2 is flipped"),
        ((0, 1, 2), "   ", 40.0, "azimuth_deg is off: add 40"),
    ],
)
def test_a_ball_bots_wrong_order_sign_or_azimuth_is_named(root, tmp_path, order, signs, turned_deg, named):
    config = configuration(root / "config/real/rob311.toml")
    robot = config["robot"]
    axes = -np.array(geometry(robot | {"wheel_azimuth_deg": robot["wheel_azimuth_deg"] + turned_deg})["T_ob"])
    bodies = "".join(
        f'<body name="w{i}"><joint name="j{i}" axis="{" ".join(map(str, axes[:, i]))}"/>'
        '<geom type="sphere" size="0.02" contype="0" conaffinity="0"/></body>'
        for i in range(3)
    )
    path = tmp_path / "ball.xml"
    path.write_text(BALL_BOT.format(wheels=bodies))
    wheels = [f"{sign.strip()}j{i}" for i, sign in zip(order, signs, strict=True)]
    described = {"base": "base", "axes": ["x", "y", "z"], "wheels": wheels}
    mistake = foreign_model.mistake(foreign_model.Robot(path, described, config, 0.0), config)
    assert named in mistake and bool(mistake) == bool(named)


FETCHED = {
    "openballbot": "salehiac+OpenBallBot-RL/ballbotgym/ballbotgym/assets/bbot.xml",
    "upkie": "upkie+upkie_description/urdf/upkie.urdf",
}


@pytest.mark.slow
@pytest.mark.parametrize(("drive_mps", "yaw_hz"), [(0.2, 0.0), (0.0, 0.1)])
@pytest.mark.parametrize("name", FETCHED)
def test_a_fetched_model_stands_drives_and_turns(root, name, drive_mps, yaw_hz):
    path = FETCHED[name]
    folder = Path(os.environ.get("EQUIPOISE_FOREIGN_MODELS", root.parent / "shared/models"))
    if not (folder / path).exists():
        pytest.skip(f"no {path} in EQUIPOISE_FOREIGN_MODELS: docs/lockstep.md says where it is from")
    given = ("--drive-mps", drive_mps, "--yaw-hz", yaw_hz)
    done, result = drive(folder / path, root / f"config/real/models/{name}.toml", *given)
    assert done.returncode == 0, done.stderr
    assert result["yaw_hz"] == pytest.approx(yaw_hz, rel=0.05, abs=0.005)
    if drive_mps:
        assert result["speed_m_s"] == pytest.approx(drive_mps, rel=0.02)
