"""The MIP's controllers on its exact dynamics: RK4 at 1 ms, control at 200 Hz, many runs at once.

True tilt and rates; the encoder angle is quantised. Coulomb friction, a late tick and the form of the
dynamics (`lateral`) are options. |u| of each wheel saturates at 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from derive import mip

from . import mip_gains
from .mip_gains import TICK_S

STEP_S = 0.001
SMOOTHING_RAD_S = 0.05  # of the plant's Coulomb friction: sign(x) as tanh(x / this)
COUNT_RAD = 2 * np.pi / (60 * 35.577)  # eduMIP encoder


@dataclass(frozen=True)
class Scenario:
    controller: str  # slc, published (run at 100 Hz), lqr
    yaw_rad_s: float = 0.0
    lateral: float = 1.0
    coulomb_N_m: float = 0.0  # per motor
    delay_ticks: int = 0
    tilt_rad: float = 0.1  # at the start


@dataclass(frozen=True)
class Outcome:
    held: bool
    tilt_rms_rad: float  # second half
    wheel_rms_rad: float
    yaw_mean_rad_s: float


@lru_cache(maxsize=1)
def _equations():
    mass, rhs = mip.exact()
    numbers = {mip.P[k]: v for k, v in mip.TABLE_3_2.items() if k != "lateral"}
    outputs = [mass[0, 0], mass[0, 1], mass[1, 1], mass[2, 2], *rhs]
    arguments = (*mip.STATE, *mip.INPUT, mip.P["lateral"])
    return sp.lambdify(arguments, [e.subs(numbers) for e in outputs], cse=True)


class _World:
    def __init__(self, scenarios):
        self.lateral = np.array([s.lateral for s in scenarios])
        self.coulomb = np.array([s.coulomb_N_m for s in scenarios]) / mip.TABLE_3_2["k1"]

    def derivative(self, x, u):
        """x: theta, phi, psi and their rates; u: u_x, u_z."""
        half = x[5] * mip.TABLE_3_2["d"] / (2 * mip.TABLE_3_2["r"])
        lost = [self.coulomb * np.tanh((x[4] + sign * half) / SMOOTHING_RAD_S) for sign in (1, -1)]
        u = (u[0] - (lost[0] + lost[1]) / 2, u[1] - (lost[0] - lost[1]) / 2)
        m11, m12, m22, m33, b1, b2, b3 = _equations()(x[0], x[3], x[4], x[5], *u, self.lateral)
        determinant = m11 * m22 - m12**2
        a = ((m22 * b1 - m12 * b2) / determinant, (m11 * b2 - m12 * b1) / determinant, b3 / m33)
        return np.vstack([x[3:], *a])

    def step(self, x, u, h):
        k1 = self.derivative(x, u)
        k2 = self.derivative(x + h / 2 * k1, u)
        k3 = self.derivative(x + h / 2 * k2, u)
        k4 = self.derivative(x + h * k3, u)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


class _Filter:
    """Second order, transposed direct form, one per run."""

    def __init__(self, tf, runs):
        self.b, self.a = tf
        self.s = np.zeros((2, runs))

    def update(self, value):
        out = self.b[0] * value + self.s[0]
        self.s = np.array(
            [self.b[1] * value - self.a[1] * out + self.s[1], self.b[2] * value - self.a[2] * out]
        )
        return out


class _Controller:
    """One kind of controller for all its runs."""

    def __init__(self, kind, scenarios):
        self.slc = mip_gains.PUBLISHED if kind == "published" else mip_gains.slc_design()
        self.period = round(1 / (self.slc.rate_hz * TICK_S))
        self.gains = mip_gains.lqr_gains() if kind == "lqr" else None
        self.D1, self.D2 = (_Filter(tf, len(scenarios)) for tf in (self.slc.D1, self.slc.D2))
        self.yaw = np.array([s.yaw_rad_s for s in scenarios])
        self.yaw_feedforward = mip_gains.yaw_feedforward()

    def update(self, x, time):
        phi = np.round(x[1] / COUNT_RAD) * COUNT_RAD
        if self.gains is None:
            u_x = self.D1.update(self.D2.update(-phi) - x[0])
        else:
            u_x = -(self.gains @ np.array([x[0], phi, x[3], x[4]]))
        ramp = np.clip(time - 1.0, 0.0, 1.0)  # spin up during the second second
        rate = self.yaw * ramp
        angle = self.yaw * (ramp**2 / 2 + max(time - 2.0, 0.0))
        u_z = self.slc.yaw[0] * (angle - x[2]) + self.slc.yaw[1] * (rate - x[5])
        u_z += self.yaw_feedforward * rate
        wheels = np.clip([u_x + u_z, u_x - u_z], -1, 1)
        return np.array([(wheels[0] + wheels[1]) / 2, (wheels[0] - wheels[1]) / 2])


def simulate(scenarios: list[Scenario], duration_s: float = 10.0) -> list[Outcome]:
    """All scenarios must share controller and delay."""
    (kind,), (delay,) = {s.controller for s in scenarios}, {s.delay_ticks for s in scenarios}
    dt, runs = TICK_S, len(scenarios)
    world, controller = _World(scenarios), _Controller(kind, scenarios)
    x = np.zeros((6, runs))
    x[0] = [s.tilt_rad for s in scenarios]
    queue, u = [np.zeros((2, runs))] * delay, np.zeros((2, runs))
    ticks = round(duration_s / dt)
    fell, sums, yaw_start = np.zeros(runs, bool), np.zeros((2, runs)), np.zeros(runs)
    for tick in range(ticks):
        if tick % controller.period == 0:
            u = controller.update(x, tick * dt)
        queue.append(u)
        applied = queue.pop(0)
        for _ in range(round(dt / STEP_S)):
            x = world.step(x, applied, STEP_S)
        fell |= (np.abs(x[0]) > 0.8) | ~np.isfinite(x[0])
        x[:, fell] = 0.0
        if tick == ticks // 2:
            yaw_start = x[2].copy()
        if tick >= ticks // 2:
            sums += x[:2] ** 2
    rms = np.sqrt(sums / (ticks - ticks // 2))
    yaw = (x[2] - yaw_start) / (duration_s - (ticks // 2 + 1) * dt)
    return [Outcome(not f, *map(float, v)) for f, *v in zip(fell, *rms, yaw, strict=True)]
