"""Samples drawn from the filters' own model: process and sensors with the noise that they believe in, so that
NIS must be 1. The robot is held upright by an LQR that knows its state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_discrete_are

from .model import AT, DT, MOVED, PHI, ROWS, SCALE, Model, N, Robot
from .recorded import Samples


def _feedback(model: Model) -> np.ndarray:
    _, F = model.predict(np.zeros((N, 1)), np.zeros((3, 1)))
    A, B = F[0][np.ix_(MOVED, MOVED)], model.B[MOVED]
    P = solve_discrete_are(A, B, np.diag([100.0, 100.0, 1.0, 1.0, 1.0, 0.1, 0.1]), 10.0 * np.eye(3))
    return np.linalg.solve(10.0 * np.eye(3) + B.T @ P @ B, B.T @ P @ A)


def draw(robot: Robot, runs: int, ticks: int, yaw_hz: float, seed: int) -> Samples:
    """The wheels' scale is as configured: the filters treat it as not learnt about x and y."""
    model = Model(replace(robot, age_s=0.0))
    rng = np.random.default_rng(seed)
    wanted = np.zeros((len(MOVED), 1))
    wanted[MOVED.index(AT["dtz"])] = 2.0 * np.pi * yaw_hz
    hold = np.zeros((3, 1))
    hold[2] = -(robot.value("k2_ball") + robot.value("mu_v")) / robot.value("k1") * 2.0 * np.pi * yaw_hz
    K = _feedback(model)
    root_Q, root_R = np.linalg.cholesky(model.Q), np.sqrt(robot.r)[:, None]
    x0 = np.zeros((N, runs))
    x0[AT["dtz"]] = wanted[MOVED.index(AT["dtz"])]
    x = x0 + np.sqrt(robot.initial_variance)[:, None] * rng.standard_normal((N, runs))
    x[SCALE] = 0.0
    heading = np.zeros(runs)
    acted, y = np.empty((ticks, 3, runs)), np.empty((ticks, ROWS, runs))
    truth = np.empty((ticks, 5, runs))
    for k in range(ticks):
        u = hold - K @ (x[MOVED] - wanted)
        rate = x[AT["dtz"]]
        x = model.step(x, u, x[SCALE]) + root_Q @ rng.standard_normal((N, runs))
        x[SCALE] = 0.0
        heading = heading + 0.5 * DT * (rate + x[AT["dtz"]])
        acted[k] = u
        y[k] = model.measure(x, u, x[SCALE]) + root_R * rng.standard_normal((ROWS, runs))
        truth[k, :2], truth[k, 2:4], truth[k, 4] = x[:2], x[PHI], heading
    t_s = DT * np.arange(1, ticks + 1)
    return Samples(
        model.robot, x0, acted, acted, y, np.ones_like(y), t_s, truth, truth, np.ones((ticks, runs)), 0.0
    )
