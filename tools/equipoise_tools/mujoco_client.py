"""MuJoCo behind `equipoise run --backend lockstep`: the board's IMU delay, [T]'s noise, floor grip 0.6.

    build/host/equipoise run --config config/mbbr.toml --backend lockstep --socket /tmp/mbbr.sock \\
        --set motor.bridge=drive_brake --set friction.compensation=0.0 --yaw-hz 1 --drive-mps 0.2 &
    build/venv/bin/python -m equipoise_tools.mujoco_client /tmp/mbbr.sock --duration-s 30

A floating body on a free ball that touches the floor: full rigid-body dynamics, so it spins, slides and
tumbles as it will. Bridges are linear, gears without friction, as the two --set say (docs/lockstep.md).
"""

from __future__ import annotations

import argparse
import socket
import time
from collections import deque

import numpy as np

from .lockstep_client import (
    DT,
    I_BALL,
    I_BODY,
    I_WHEELS,
    I_YAW,
    IMU_Z,
    K1,
    K2,
    M_BALL,
    M_BODY,
    R_WHEEL,
    WHEEL_AXES,
    G,
    L,
    R,
)
from .paths import UserError, import_lcm_types

STEP = 0.0005
# RM-MPU-9250A, low-pass register 2 (include/equipoise/imu_parts.h).
GYRO_DELAY_S, ACCEL_DELAY_S = 3.9e-3, 2.88e-3
GYRO_SIGMA, ACCEL_SIGMA, ENCODER_SIGMA = 0.001442, 1.187, 0.008729  # [T] (6.23)

MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{g}" integrator="implicitfast" cone="elliptic" impratio="20"/>
  <worldbody>
    <geom name="floor" type="plane" size="50 50 1" friction="{grip} {torsion} 0" condim="4" solref="0.002 1"/>
    <body name="robot" pos="0 0 {r}">
      <freejoint name="base"/>
      <inertial pos="0 0 {l}" mass="{m_body}" diaginertia="{i_body} {i_body} {i_yaw}"/>
      <site name="imu" pos="0 0 {imu}"/>
      <body name="ball">
        <joint name="wheels" type="ball" armature="{i_wheels}"/>
        <inertial pos="0 0 0" mass="{m_ball}" diaginertia="{i_ball} {i_ball} {i_ball}"/>
        <geom type="sphere" size="{r}" friction="{grip} {torsion} 0" condim="4" solref="0.002 1"/>
      </body>
    </body>
  </worldbody>
  <sensor>
    <gyro name="gyro" site="imu"/>
    <accelerometer name="accel" site="imu"/>
  </sensor>
</mujoco>
"""


def import_mujoco():
    try:
        import mujoco
    except ModuleNotFoundError:
        raise UserError("MuJoCo is not installed: build/venv/bin/pip install mujoco") from None
    return mujoco


def quaternion_matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Robot:
    """The engine's robot: `advance` with duties, `sensors` as the boundary wants them."""

    step_s = STEP

    def __init__(
        self, tilt_rad: float = 0.02, grip: float = 0.6, torsion_radius_m: float = 0.005, seed: int = 1
    ):
        self.mujoco = import_mujoco()
        self.model = self.mujoco.MjModel.from_xml_string(
            MODEL.format(
                step=STEP,
                g=G,
                grip=grip,
                torsion=grip * torsion_radius_m,
                r=R,
                l=L,
                imu=IMU_Z,
                m_body=M_BODY,
                m_ball=M_BALL,
                i_body=I_BODY,
                i_yaw=I_YAW,
                i_ball=I_BALL,
                i_wheels=I_WHEELS,
            )
        )
        self.data = self.mujoco.MjData(self.model)
        self.data.qpos[3:7] = [np.cos(tilt_rad / 2), np.sin(tilt_rad / 2), 0.0, 0.0]
        self.mujoco.mj_forward(self.model, self.data)
        self.rng = np.random.default_rng(seed)
        self.wheels = np.zeros(3)
        self.held = True  # by a hand, until the motors first run
        record = (np.zeros(3), self.R_WB().T @ np.array([0.0, 0.0, G]))
        self.past = deque([record] * 32, maxlen=32)  # newest first

    def R_WB(self) -> np.ndarray:
        return quaternion_matrix(self.data.qpos[3:7])

    def ball_rate_B(self) -> np.ndarray:
        """Of the ball relative to the body: MuJoCo has it in the ball's own axes."""
        return quaternion_matrix(self.data.qpos[7:11]) @ self.data.qvel[6:9]

    def tilt_rad(self) -> float:
        return float(np.arccos(np.clip(self.R_WB()[2, 2], -1.0, 1.0)))

    def speed_m_s(self) -> float:
        return float(np.hypot(*self.data.qvel[:2]))

    def yaw_rate_rad_s(self) -> float:
        return float((self.R_WB() @ self.data.qvel[3:6])[2])

    def advance(self, duty: np.ndarray, enabled: bool) -> None:
        self.held = self.held and not enabled
        for _ in range(0 if self.held else round(DT / STEP)):
            rate = self.ball_rate_B()
            torque = K1 * (R / R_WHEEL) * WHEEL_AXES @ duty - K2 * rate if enabled else np.zeros(3)
            self.data.qfrc_applied[6:9] = quaternion_matrix(self.data.qpos[7:11]).T @ torque
            self.mujoco.mj_step(self.model, self.data)
            self.wheels += STEP * (R / R_WHEEL) * WHEEL_AXES.T @ self.ball_rate_B()
            self.past.appendleft(
                (self.data.sensor("gyro").data.copy(), self.data.sensor("accel").data.copy())
            )

    def _late(self, which: int, delay_s: float) -> np.ndarray:
        steps = delay_s / self.step_s
        k, share = int(steps), steps % 1.0
        return (1 - share) * self.past[k][which] + share * self.past[k + 1][which]

    def sensors(self, step: int):
        message = import_lcm_types().lockstep_sensors_t()
        message.step, message.t_s, message.battery_V = step, step * DT, 8.0
        noise = self.rng.normal(size=9)
        message.gyro_B_rad_s = (self._late(0, GYRO_DELAY_S) + GYRO_SIGMA * noise[:3]).tolist()
        message.specific_force_B_m_s2 = (self._late(1, ACCEL_DELAY_S) + ACCEL_SIGMA * noise[3:6]).tolist()
        message.wheel_angle_rad = [*(self.wheels + ENCODER_SIGMA * noise[6:]), 0.0]
        return message


def connect(connection: socket.socket, path: str, patience_s: float = 10.0) -> None:
    """The firmware may still be starting."""
    until = time.monotonic() + patience_s
    while True:
        try:
            connection.connect(path)
            return
        except (FileNotFoundError, ConnectionRefusedError):
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def balance(path: str, duration_s: float, robot: Robot, fallen_rad: float = 0.6) -> dict:
    """Steps until the time is over, the controller stops or the robot has fallen."""
    steps, ended, speeds, rates = round(duration_s / DT), "finished", [], []
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connect(connection, path)
        for step in range(steps):
            message = robot.sensors(step)
            message.last = step == steps - 1
            connection.send(message.encode())
            motors = import_lcm_types().lockstep_motors_t.decode(connection.recv(512))
            robot.advance(np.array(motors.duty[:3]), motors.enable)
            speeds.append(robot.speed_m_s())
            rates.append(robot.yaw_rate_rad_s())
            if robot.tilt_rad() > fallen_rad:
                ended = "fell"
                break
            if motors.last and not message.last:
                ended = "stopped by the firmware"
                break
    second_half = slice(len(speeds) // 2, None)
    return {
        "ended": ended,
        "upright": ended != "fell" and robot.tilt_rad() < fallen_rad,
        "time_s": len(speeds) * DT,
        "speed_m_s": float(np.mean(speeds[second_half])),
        "yaw_hz": float(np.mean(rates[second_half]) / (2 * np.pi)),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.mujoco_client", description=__doc__.splitlines()[0]
    )
    parser.add_argument("socket", help="path given to equipoise run --socket")
    parser.add_argument("--duration-s", type=float, default=30.0)
    parser.add_argument("--grip", type=float, default=0.6, help="friction coefficient of the floor")
    parser.add_argument("--torsion-radius-m", type=float, default=0.005, help="of the contact")
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    given = parser.parse_args()
    try:
        robot = Robot(grip=given.grip, torsion_radius_m=given.torsion_radius_m, seed=given.seed)
        result = balance(given.socket, given.duration_s, robot)
    except (UserError, OSError) as error:
        print(f"error: {error}")
        return 2
    print(
        f"{result['ended']} after {result['time_s']:.1f} s, yaw {result['yaw_hz']:+.2f} Hz, "
        f"speed {result['speed_m_s']:.3f} m/s"
    )
    return 0 if result["upright"] and result["ended"] == "finished" else 1


if __name__ == "__main__":
    raise SystemExit(main())
