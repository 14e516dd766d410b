"""The scheduled gains on the exact MBBR: RK4 at 1 ms, control at 200 Hz on the true state, many runs at once.

Motors are torque sources with back-EMF; each wheel saturates at |u| = 1; Coulomb friction is optional.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from derive import mbbr

from . import mbbr_gains

STEP_S = 0.001
SMOOTHING_RAD_S = 0.05  # of the plant's Coulomb friction: sign(x) as tanh(x / this)


@dataclass(frozen=True)
class Scenario:
    yaw_hz: float
    drive_m_s: float = 0.3
    coulomb_N_m: float = 0.0
    compensation: float = 0.0  # share of Coulomb friction that is compensated, [T] (6.14)-(6.15)
    delay_ticks: int = 0


@dataclass(frozen=True)
class Outcome:
    held: bool
    tilt_max_rad: float  # after the first half
    speed_rms_error_m_s: float  # after the first half
    duty_max: float
    yaw_mean_hz: float


def _function(outputs):
    """Outputs as one array (outputs, runs) of (state, torque)."""
    numbers = {mbbr.P[k]: v for k, v in mbbr.TABLE_5_2.items()}
    f = sp.lambdify((*mbbr.STATE, *mbbr.TORQUE), [e.subs(numbers) for e in outputs], cse=True)

    def evaluate(state, tau):
        values = np.empty((len(outputs), state.shape[1]))
        for i, value in enumerate(f(*state, *tau)):
            values[i] = value
        return values

    return evaluate


@lru_cache(maxsize=1)
def _rates():
    """Encoder rate and body rate."""
    m = mbbr.motion()
    return _function([*m.encoder_rate_B, *m.omega_B])


@lru_cache(maxsize=1)
def _dynamics():
    mass, rhs = mbbr.exact()
    equations = _function([*mass, *rhs])

    def accelerations(state, tau):
        values = equations(state, tau)
        matrix = values[:25].reshape(5, 5, -1).transpose(2, 0, 1)
        return np.linalg.solve(matrix, values[25:].T[:, :, None])[:, :, 0].T

    return accelerations


def _wheel_axes():
    """Orthonormal wheel axes, all at the same angle to the vertical; [T] (6.5) up to the azimuth."""
    angles = np.radians([0, 120, 240])
    return np.array([np.sqrt(2 / 3) * np.cos(angles), np.sqrt(2 / 3) * np.sin(angles), np.full(3, 3**-0.5)])


class _World:
    def __init__(self, scenarios):
        p = mbbr.TABLE_5_2
        self.k1, self.k_d = p["k1"], p["k2_ball"] + p["mu_v"]
        self.coulomb = np.array([s.coulomb_N_m for s in scenarios])

    def derivative(self, x, u):
        """x: theta_x, theta_y, the five speeds, theta_z, inertial phi_x, phi_y."""
        rate = _rates()(x[:7], np.zeros((3, 1)))[:3]
        tau = self.k1 * u - self.k_d * rate - self.coulomb * np.tanh(rate / SMOOTHING_RAD_S)
        accelerations = _dynamics()(x[:7], tau)
        phi_dot = (x[5] + 1j * x[6]) * np.exp(1j * x[7])
        return np.vstack([x[2:4], accelerations, x[4], phi_dot.real, phi_dot.imag])

    def step(self, x, u, h):
        k1 = self.derivative(x, u)
        k2 = self.derivative(x + h / 2 * k1, u)
        k3 = self.derivative(x + h / 2 * k2, u)
        k4 = self.derivative(x + h * k3, u)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


class _Controller:
    def __init__(self, scenarios):
        self.yaw_target = 2 * np.pi * np.array([s.yaw_hz for s in scenarios])
        self.target = np.array([s.drive_m_s for s in scenarios]) / mbbr.TABLE_5_2["r"]  # rad/s, inertial x
        self.compensation = (
            np.array([s.compensation * s.coulomb_N_m for s in scenarios]) / mbbr.TABLE_5_2["k1"]
        )
        self.T = _wheel_axes()
        self.ratio = mbbr.TABLE_5_2["r"] / mbbr.TABLE_5_2["r_w"]
        d = mbbr_gains.design()
        self.d, self.at = d, np.array([r.yaw_rate for r in d.rows])
        self.table = np.array([r.gains for r in d.rows])
        self.yaw_rate = np.zeros(len(scenarios))
        self.speed = np.zeros(len(scenarios))
        self.phi = np.zeros(len(scenarios))
        self.theta_z = np.zeros(len(scenarios))

    def gains(self, yaw_rate):
        size = np.abs(yaw_rate)
        K = np.array([np.interp(size, self.at, self.table[:, i]) for i in range(4)])
        return np.where(yaw_rate < 0, K.conj(), K)

    def update(self, x, encoder_rate, body_rate, dt):
        acceleration = np.clip(self.target - self.speed, -15.0 * dt, 15.0 * dt) / dt  # 0.5 m/s^2
        self.yaw_rate += np.clip(self.yaw_target - self.yaw_rate, -2 * np.pi * dt, 2 * np.pi * dt)
        self.speed = self.speed + acceleration * dt
        self.phi = self.phi + self.speed * dt
        self.theta_z += self.yaw_rate * dt
        to_yaw_frame = np.exp(-1j * x[7])
        speed_ref, phi_ddot_ref = self.speed * to_yaw_frame, acceleration * to_yaw_frame
        p = mbbr_gains.reference_terms()
        error = np.array(
            [
                x[0] + 1j * x[1] - p.lean * phi_ddot_ref,
                (x[8] + 1j * x[9] - self.phi) * to_yaw_frame,
                body_rate[0] + 1j * body_rate[1],
                x[5] + 1j * x[6] - speed_ref,
            ]
        )
        speed_gain = p.speed - 1j * p.speed_turn * self.yaw_rate
        u = np.sum(self.gains(x[4]) * error, axis=0) + speed_gain * speed_ref + p.drive * phi_ddot_ref
        u_z = (
            self.d.yaw_gains @ [x[7] - self.theta_z, x[4] - self.yaw_rate]
            + self.d.yaw_feedforward * self.yaw_rate
        )
        u = np.array([u.real, u.imag, u_z])
        u += self.compensation * np.sign(encoder_rate) * (1 - np.exp(-2 * np.abs(encoder_rate)))
        wheels = self.T.T @ u / self.ratio
        return self.ratio * self.T @ np.clip(wheels, -1, 1), np.max(np.abs(wheels), axis=0)


def simulate(scenarios: list[Scenario], duration_s: float = 10.0) -> list[Outcome]:
    dt = mbbr_gains.TICK_S
    world, controller = _World(scenarios), _Controller(scenarios)
    runs = len(scenarios)
    x = np.zeros((10, runs))
    x[0], x[1] = 0.02, -0.01
    queue = [np.zeros((3, runs))] * (max(s.delay_ticks for s in scenarios) + 1)
    delays = np.array([s.delay_ticks for s in scenarios])
    ticks = round(duration_s / dt)
    fell = np.zeros(runs, bool)
    tilt, duty, yaw_start, error = np.zeros(runs), np.zeros(runs), np.zeros(runs), np.zeros(runs)
    for tick in range(ticks):
        rates = _rates()(x[:7], np.zeros((3, 1)))
        encoder_rate, body_rate = rates[:3], rates[3:]
        u, peak = controller.update(x, encoder_rate, body_rate, dt)
        queue = [u, *queue[:-1]]
        applied = np.choose(delays, queue) if len(queue) > 1 else u
        for _ in range(round(dt / STEP_S)):
            x = world.step(x, applied, STEP_S)
        lean = np.hypot(x[0], x[1])
        fell |= (lean > 0.6) | ~np.isfinite(lean)
        x[:, fell] = 0.0  # a fallen robot stays down and does not disturb the arithmetic
        if tick == ticks // 2:
            yaw_start = x[7].copy()
        if tick >= ticks // 2:
            tilt, duty = np.maximum(tilt, lean), np.maximum(duty, peak)
            error += np.abs((x[5] + 1j * x[6]) * np.exp(1j * x[7]) - controller.speed) ** 2
    half = duration_s - (ticks // 2 + 1) * dt
    rms = mbbr.TABLE_5_2["r"] * np.sqrt(error / (ticks - ticks // 2))
    yaw = (x[7] - yaw_start) / half / (2 * np.pi)
    return [Outcome(not f, *map(float, v)) for f, *v in zip(fell, tilt, rms, duty, yaw, strict=True)]
