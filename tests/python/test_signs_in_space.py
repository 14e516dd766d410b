"""Signs of both robots where only 3-D geometry decides: MuJoCo's wheels, each on its side."""

import subprocess
import tomllib

import numpy as np
import pytest

pytest.importorskip(
    "mujoco", reason="mujoco is not installed (tools/test installs tools/requirements-optional.txt)"
)
import mujoco
from equipoise_tools import mujoco_client
from equipoise_tools.paths import import_lcm_types

# librobotcontrol's rc_balance: left wheel on eQEP2 (encoder 3), right wheel on eQEP1 (encoder 2).
SIDE_OF_ENCODER = {"48304180": "left", "48302180": "right"}

# Body x left, y back, z up. A wheel touches the floor in one point: a sphere of its radius.
EDUMIP = """
<mujoco>
  <compiler balanceinertia="true"/>
  <option timestep="0.0005" gravity="0 0 -9.8" integrator="implicitfast" cone="elliptic" impratio="20"/>
  <default><geom friction="0.8 0.002 0" condim="4" solref="0.002 1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="20 20 1"/>
    <body name="robot" pos="0 0 {wheel_radius_m}">
      <freejoint/>
      <inertial pos="0 0 {com_height_m}" mass="{body_mass_kg}" diaginertia="{body}"/>
      <site name="imu" pos="{imu}"/>
      <body name="left" pos="{half_track} 0 0">
        <joint name="left" type="hinge" axis="1 0 0" armature="{rotor}"/>
        <inertial pos="0 0 0" mass="{wheel_mass_kg}" diaginertia="{wheel}"/>
        <geom type="sphere" size="{wheel_radius_m}"/>
      </body>
      <body name="right" pos="-{half_track} 0 0">
        <joint name="right" type="hinge" axis="1 0 0" armature="{rotor}"/>
        <inertial pos="0 0 0" mass="{wheel_mass_kg}" diaginertia="{wheel}"/>
        <geom type="sphere" size="{wheel_radius_m}"/>
      </body>
    </body>
  </worldbody>
  <sensor><gyro name="gyro" site="imu"/><accelerometer name="accel" site="imu"/></sensor>
</mujoco>
"""


def spaced(values):
    return " ".join(map(str, values))


class EduMip:
    """`order`: the sides of motor and wheel 1 and 2."""

    def __init__(self, robot: dict, order: list[str], forward_lean_rad: float):
        about_axle, across, _ = robot["wheel_inertia_kg_m2"]
        text = EDUMIP.format(
            **robot,
            half_track=robot["track_m"] / 2,
            body=spaced(robot["body_inertia_kg_m2"]),
            wheel=spaced([across, across, across]),
            rotor=about_axle - across,  # a disc alone cannot have this much
            imu=spaced(robot["imu_position_m"]),
        )
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data, self.order, self.k = mujoco.MjData(self.model), order, (robot["k1_N_m"], robot["k2_N_m_s"])
        half = forward_lean_rad / 2  # the top goes forwards, to -y, when x points left
        self.data.qpos[3:7] = [np.cos(half), np.sin(half), 0.0, 0.0]
        mujoco.mj_forward(self.model, self.data)
        self.held = True  # by a hand, until the motors first run
        self.heading_rad = 0.0
        self.forward_m = 0.0

    def R_WB(self):
        return self.data.body("robot").xmat.reshape(3, 3)

    def advance(self, duty, enabled):
        self.held = self.held and not enabled
        for _ in range(0 if self.held else 10):
            for side, u in zip(self.order, duty[:2], strict=True):
                joint = self.data.joint(side)
                joint.qfrc_applied[0] = self.k[0] * u - self.k[1] * joint.qvel[0] if enabled else 0.0
            mujoco.mj_step(self.model, self.data)
            forward_W = np.cross(self.R_WB()[:, 0], [0.0, 0.0, 1.0])  # left x up = forwards... of the axle
            self.forward_m += 0.0005 * float(forward_W @ self.data.qvel[:3])
            self.heading_rad += 0.0005 * float((self.R_WB() @ self.data.qvel[3:6])[2])

    def sensors(self, step):
        message = import_lcm_types().lockstep_sensors_t()
        message.step, message.t_s, message.battery_V = step, step * 0.005, 7.4
        message.gyro_B_rad_s = self.data.sensor("gyro").data.tolist()
        force = self.R_WB().T @ [0.0, 0.0, 9.8] if self.held else self.data.sensor("accel").data
        message.specific_force_B_m_s2 = force.tolist()
        message.wheel_angle_rad = [*(float(self.data.joint(side).qpos[0]) for side in self.order), 0.0, 0.0]
        return message

    def tilt_rad(self):
        return float(np.arccos(np.clip(self.R_WB()[2, 2], -1.0, 1.0)))

    def speed_m_s(self):
        return float(np.hypot(*self.data.qvel[:2]))

    def yaw_rate_rad_s(self):
        return float((self.R_WB() @ self.data.qvel[3:6])[2])


def lockstep(root, tmp_path, config, robot, duration_s, *arguments):
    path = tmp_path / "io.sock"
    command = [root / "build/host/equipoise", "run", "--config", root / "config" / config]
    command += ["--backend", "lockstep", "--socket", path, "--log", "off", "--telemetry", "off"]
    command += ["--set", "motor.bridge=drive_brake", "--set", "friction.compensation=0.0"]
    command += [*arguments, "--timeout-s", "5"]
    with subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True) as firmware:
        result = mujoco_client.balance(str(path), duration_s, robot)
        firmware.communicate(timeout=60)
    return result


def sides_of(board: dict) -> list[str]:
    return [SIDE_OF_ENCODER[motor["encoder"]] for motor in board["motor"]]


def edumip(root, lean_rad, order=None):
    robot = tomllib.loads((root / "config/edumip.toml").read_text())["robot"]
    boards = [
        tomllib.loads((root / f"config/boards/{name}.toml").read_text())
        for name in ("robotics_cape_edumip", "beaglebone_blue_edumip")
    ]
    cape, blue = map(sides_of, boards)
    assert cape == blue
    return EduMip(robot, order or cape, lean_rad)


LIVE = ["--set", "chain.gyro_delay_s=0"]


@pytest.mark.parametrize("lean_rad", [0.05, -0.05])
def test_an_edumip_wired_as_its_board_files_say_drives_forwards_and_turns_left(root, tmp_path, lean_rad):
    robot = edumip(root, lean_rad)
    asked = [*LIVE, "--drive-mps", 0.1, "--yaw-hz", 0.1]
    result = lockstep(root, tmp_path, "edumip.toml", robot, 6.0, *asked)
    assert result["ended"] == "finished" and result["upright"]
    assert robot.forward_m > 0.25
    assert robot.heading_rad > 1.5


@pytest.mark.parametrize("lean_rad", [0.02, -0.045, 0.06])
def test_with_its_wheels_exchanged_a_turn_does_not_run_away(root, tmp_path, lean_rad):
    """It feeds itself. Motors go off, or a sensor is excluded and the robot stands: which one depends on the
    last digits. Without detection it turns by 2 to 3 rad."""
    robot = edumip(root, lean_rad, order=["left", "right"])
    asked = [*LIVE, "--yaw-hz", 0.1]
    ended = lockstep(root, tmp_path, "edumip.toml", robot, 6.0, *asked)["ended"]
    assert ended != "finished" or abs(robot.yaw_rate_rad_s()) < 0.05
    assert abs(robot.heading_rad) < 1.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_mbbr_goes_where_plus_x_is_and_turns_left(root, tmp_path, sign):
    robot = mujoco_client.Robot(tilt_rad=0.0)
    result = lockstep(root, tmp_path, "mbbr.toml", robot, 4.0, "--drive-mps", sign * 0.1)
    assert result["upright"]
    assert sign * robot.data.qpos[0] > 0.15 and abs(robot.data.qpos[1]) < 0.05
    robot = mujoco_client.Robot(tilt_rad=0.02)
    lockstep(root, tmp_path, "mbbr.toml", robot, 4.0, "--yaw-hz", sign * 0.5)
    assert sign * robot.yaw_rate_rad_s() == pytest.approx(np.pi, abs=0.4)
