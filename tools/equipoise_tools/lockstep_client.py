"""A physics engine for `equipoise run --backend lockstep` in about fifty lines: the MBBR, no friction.

    build/host/equipoise run --config config/mbbr.toml --backend lockstep --socket /tmp/mbbr.sock \
        --set motor.bridge=drive_brake --set friction.compensation=0.0 --set chain.gyro_delay_s=0 &
    build/venv/bin/python -m equipoise_tools.lockstep_client /tmp/mbbr.sock --duration-s 20

The protocol is docs/lockstep.md; replace `Robot` by your engine.
"""

from __future__ import annotations

import argparse
import socket

import numpy as np

from .entry import leave
from .paths import import_lcm_types

G, DT, SUBSTEPS = 9.8, 0.005, 5
# [T] Table 5.2: masses, radii, centre of mass, inertias; torque per u and back-EMF about the ball.
M_BODY, M_BALL, R, R_WHEEL, L, IMU_Z = 0.550, 0.150, 0.032, 0.0125, 0.100, 0.130
I_BODY, I_YAW, I_BALL, I_WHEELS, K1, K2 = 2.42e-3, 0.79e-3, 8.46e-5, 1.2e-5, 0.176, 0.011
C = M_BODY * L * R - I_WHEELS
MASS = [[I_BODY + M_BODY * L**2 + I_WHEELS, C], [C, I_BALL + I_WHEELS + (M_BALL + M_BODY) * R**2]]
ALPHA, AZIMUTH = np.radians(60.0), np.radians(-140.0)  # [T] (6.5): where the wheels are; columns: their axes
BETA = np.arccos(1 / (np.sqrt(3) * np.sin(ALPHA)))
FIRST = np.array([np.cos(BETA) * np.cos(ALPHA), -np.sin(BETA), np.cos(BETA) * np.sin(ALPHA)])
TURNS = [AZIMUTH + 2 * np.pi / 3 * i for i in range(3)]
WHEEL_AXES = np.array(
    [
        [np.cos(a) * FIRST[0] - np.sin(a) * FIRST[1], np.sin(a) * FIRST[0] + np.cos(a) * FIRST[1], FIRST[2]]
        for a in TURNS
    ]
).T


class Robot:
    """Small angles, [T] (5.18): per axis, MASS [tilt'' ball''] = [m g l tilt - torque, torque]."""

    def __init__(self, tilt_rad: float) -> None:
        self.theta, self.omega = np.array([tilt_rad, 0.0, 0.0]), np.zeros(3)  # roll, pitch, yaw and rates
        self.phi, self.phi_dot = np.zeros(3), np.zeros(3)  # ball angles; it does not turn about z
        self.omega_dot, self.phi_ddot = np.zeros(3), np.zeros(3)
        self.held = True  # by a hand, until the motors first run

    def advance(self, duty: np.ndarray, enabled: bool) -> None:
        self.held = self.held and not enabled
        for _ in range(0 if self.held else SUBSTEPS):
            torque = (
                K1 * (R / R_WHEEL) * WHEEL_AXES @ duty - K2 * (self.phi_dot - self.omega)
                if enabled
                else np.zeros(3)
            )
            loads = np.array([M_BODY * G * L * self.theta[:2] - torque[:2], torque[:2]])
            self.omega_dot[:2], self.phi_ddot[:2] = np.linalg.solve(MASS, loads)
            self.omega_dot[2] = -torque[2] / (I_YAW + I_WHEELS)
            self.omega, self.phi_dot = (
                self.omega + DT / SUBSTEPS * self.omega_dot,
                self.phi_dot + DT / SUBSTEPS * self.phi_ddot,
            )
            self.theta, self.phi = (
                self.theta + DT / SUBSTEPS * self.omega,
                self.phi + DT / SUBSTEPS * self.phi_dot,
            )

    def sensors(self, step: int):
        x, y, _ = self.theta
        lever = R * self.phi_ddot + IMU_Z * self.omega_dot
        message = import_lcm_types().lockstep_sensors_t()
        message.step, message.t_s, message.battery_V = step, step * DT, 8.0
        message.gyro_B_rad_s = self.omega.tolist()
        message.specific_force_B_m_s2 = [lever[1] - G * y, -lever[0] + G * x, G]
        message.wheel_angle_rad = [*((R / R_WHEEL) * WHEEL_AXES.T @ (self.phi - self.theta)), 0.0]
        return message


def balance(path: str, duration_s: float, tilt_rad: float = 0.02) -> Robot:
    """Steps until the time is over, the controller stops or the robot lies on the floor."""
    robot, steps = Robot(tilt_rad), round(duration_s / DT)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.connect(path)
        for step in range(steps):
            message = robot.sensors(step)
            message.last = step == steps - 1
            connection.send(message.encode())
            motors = import_lcm_types().lockstep_motors_t.decode(connection.recv(512))
            robot.advance(np.array(motors.duty[:3]), motors.enable)
            if motors.last or np.abs(robot.theta[:2]).max() > 1.0:
                break
    return robot


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("socket", help="path given to equipoise run --socket")
    parser.add_argument("--duration-s", type=float, default=20.0)
    arguments = parser.parse_args()
    robot = balance(arguments.socket, arguments.duration_s)
    print(f"tilt {np.degrees(np.hypot(*robot.theta[:2])):.2f} deg, travelled {R * robot.phi[1]:+.3f} m")
    return 0 if np.abs(robot.theta[:2]).max() < 0.3 else 1


if __name__ == "__main__":
    leave(main)
