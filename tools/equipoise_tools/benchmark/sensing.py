"""What a peer makes of the sensors: tilt by complementary filter or the IMU's attitude, speeds, heading.

The robot that its designer knows is the shipped configuration; drawn robots differ from it. In a plane: tilt
theta, roll (the turn of ball or wheels in the world) and their rates, for u of one axis.
"""

from __future__ import annotations

import math
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from equipoise_robot import State

from ..lockstep_client import WHEEL_AXES
from ..planar_model import GRAVITY, STEP_S, of_configuration


class Known:
    """A robot as its designer knows it."""

    def __init__(self, config: dict) -> None:
        robot = config["robot"]
        self.kind = robot["type"]
        self.axes = 2 if self.kind == "mbbr" else 1
        p = of_configuration(config)
        m11 = p.rolling_inertia + (p.rolling_mass + p.body_mass) * p.radius**2 + p.rotor
        m12 = m11 - p.rotor + p.body_mass * p.radius * p.height
        m22 = 2 * m12 - m11 + p.rotor + p.body_inertia + p.body_mass * p.height**2
        inverse = np.linalg.inv([[m22, m12], [m12, m11]])  # of (theta, roll against the body)
        inverse[1] += inverse[0]  # roll in the world
        fall = inverse[:, 0] * p.body_mass * GRAVITY * p.height
        damping = (p.k2 + p.viscous) * inverse[:, 1]
        self.a = np.zeros((4, 4))  # of (theta, roll, theta', roll')
        self.a[:2, 2:] = np.eye(2)
        self.a[2:, 0] = fall
        self.a[2:, 2], self.a[2:, 3] = damping, -damping
        self.b = np.concatenate(([0.0, 0.0], p.k1 * inverse[:, 1]))
        self.hold_s = (p.k2 + p.viscous) / p.k1  # u per rad/s against back-EMF
        if self.kind == "mbbr":
            inertia = robot["body_inertia_kg_m2"][2] + p.rotor
            self.yaw_gain = -p.k1 / inertia  # the ball stays, the body turns against the torque
            self.yaw_hold_s = -p.k2 / p.k1
            ratio = robot["ball_radius_m"] / robot["wheel_radius_m"]
            self.from_wheels, self.u_of_drives = WHEEL_AXES / ratio, ratio * WHEEL_AXES
        else:
            d, r, m = robot["track_m"], robot["wheel_radius_m"], robot["wheel_mass_kg"]
            spin, _, upright = robot["wheel_inertia_kg_m2"]
            inertia = robot["body_inertia_kg_m2"][2] + 2 * upright + m * d**2 / 2 + spin * d**2 / (2 * r**2)
            self.yaw_gain = d / r * robot["k1_N_m"] / inertia
            self.yaw_hold_s = robot["k2_N_m_s"] / robot["k1_N_m"] * d / (2 * r)
            self.from_wheels = np.array([[0.5, 0.5], [r / d, -r / d]])  # phi, heading
            self.u_of_drives = np.array([[0.5, 0.5], [0.5, -0.5]])


@cache
def shipped(path: Path) -> dict:
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def known(path: Path) -> Known:
    return Known(shipped(path))


class Senses:
    """The estimator of every peer. `packets`: tilt from the IMU's own fusion, its rate by difference."""

    def __init__(self, robot: Known, packets: bool, tilt_s: float, rate_s: float) -> None:
        self.robot, self.packets = robot, packets
        self.blend, self.quick = STEP_S / (tilt_s + STEP_S), STEP_S / (rate_s + STEP_S)
        self.theta, self.theta_dot, self.phi, self.phi_dot = ([0.0, 0.0] for _ in range(4))
        self.yaw = self.yaw_rate = 0.0
        self.gyro, self.bias, self.held_ticks, self.held = [0.0] * 3, [0.0] * 3, 0, True
        self.omega = [0.0] * 3  # of the body

    def __call__(self, tick) -> State:
        if tick.held and not self.held:
            self.held_ticks = 0
        self.held = tick.held
        if tick.imu_ok:
            self.gyro = tick.gyro_B_rad_s.tolist()
        if self.held and tick.imu_ok:  # at rest the gyro's bias is its mean
            self.held_ticks += 1
            self.bias = [b + (g - b) / self.held_ticks for b, g in zip(self.bias, self.gyro, strict=True)]
        self.omega = wx, wy, wz = [g - b for g, b in zip(self.gyro, self.bias, strict=True)]
        self.yaw_rate = wz
        self.tilt(tick, wx, wy, wz)
        self.rolling(tick, wx, wy)
        state = State()
        state.theta_rad = [*self.theta, self.yaw]
        state.omega_B_rad_s = self.omega
        state.phi_rad, state.phi_dot_rad_s = self.phi, self.phi_dot
        return state

    def tilt(self, tick, wx: float, wy: float, wz: float) -> None:
        x, y = self.theta
        if self.packets:
            if tick.attitude_ok:
                new = tick.attitude_rad.tolist()[:2]
                for i, before in enumerate((x, y)):
                    self.theta_dot[i] += 0.25 * ((new[i] - before) / STEP_S - self.theta_dot[i])
                self.theta = new
            return
        turn = math.sin(x) * wy + math.cos(x) * wz  # Euler's kinematics
        self.theta_dot = [wx + math.tan(y) * turn, math.cos(x) * wy - math.sin(x) * wz]
        x, y = x + STEP_S * self.theta_dot[0], y + STEP_S * self.theta_dot[1]
        if tick.imu_ok:
            ax, ay, az = tick.accel_B_m_s2.tolist()
            share = max(self.blend, 1.0 / (1.0 + self.held_ticks)) if self.held else self.blend
            x += share * (math.atan2(-ay, -az) - x)
            y += share * (math.atan2(ax, math.hypot(ay, az)) - y)
        self.theta = [x, y]

    def rolling(self, tick, wx: float, wy: float) -> None:
        """Wheels that cannot be read turn on as they did."""
        if self.robot.kind == "mbbr":
            if tick.encoders_ok:
                rate = self.robot.from_wheels @ tick.wheel_rate_rad_s
                for i, body in enumerate((wx, wy)):
                    self.phi_dot[i] += self.quick * (rate[i] + body - self.phi_dot[i])
            self.yaw += STEP_S * self.yaw_rate
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            vx, vy = self.phi_dot
            self.phi = [self.phi[0] + STEP_S * (c * vx - s * vy), self.phi[1] + STEP_S * (s * vx + c * vy)]
            return
        if tick.encoders_ok:
            self.phi = [float(self.robot.from_wheels[0] @ tick.wheel_angle_rad), 0.0]
            rate = float(self.robot.from_wheels[0] @ tick.wheel_rate_rad_s)
            self.phi_dot[0] += self.quick * (rate - self.phi_dot[0])
            if self.packets:  # as rc_balance: the heading is the encoders'
                self.yaw = float(self.robot.from_wheels[1] @ tick.wheel_angle_rad)
        if not self.packets:
            self.yaw += STEP_S * self.yaw_rate

    def errors(self, tick) -> list[tuple[float, float, float, float]]:
        """Per axis reference minus estimate: theta (upright), roll, and their rates."""
        error, wanted = tick.error.tolist(), tick.reference.phi_dot_rad_s.tolist()
        if self.robot.kind == "mbbr":
            return [
                (-self.theta[i], error[4 + i], -self.theta_dot[i], wanted[i] - self.phi_dot[i])
                for i in range(2)
            ]
        theta, theta_dot = self.theta[0], self.theta_dot[0]
        return [(-theta, error[2] - theta, -theta_dot, wanted[0] - self.phi_dot[0] - theta_dot)]
