"""The linear Kalman filter of [T] as published, (5.27)-(5.29), on the samples of a log: attitude and ball "
"speed."""

from __future__ import annotations

import numpy as np
from equipoise_robot.log import Log
from scipy.signal import lfilter

from .. import names, published

DT_S = 0.005
# Table 5.2 and (6.5), exact; config/mbbr.toml [calibration].
BALL_RADIUS_M, WHEEL_RADIUS_M = 0.032, 0.0125
GYRO_RAD_S = np.radians(1 / 16.4)
ACCEL_M_S2 = 9.8 / 4096
WHEEL_RAD = 2 * np.pi / 720
Q, R = published.table()["(6.32)"]["q_kf"], published.table()["(6.23)"]["r_kf"]
PLANAR = (published.table()["(5.28)"]["theta_ddot"], published.table()["(5.28)"]["phi_ddot"])
ACCEL = published.table()["(5.29)"]["accel"]


def model() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """F, G, H, D for x = theta x y, phi x y, theta' x y, phi' x y; explicit Euler as (6.1)."""
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    H, D = np.zeros((6, 8)), np.zeros((6, 2))
    A[:4, 4:] = np.eye(4)
    for axis in range(2):
        for row, (theta, theta_dot, phi_dot, u) in zip((4 + axis, 6 + axis), PLANAR, strict=True):
            A[row, [axis, 4 + axis, 6 + axis]] = theta, theta_dot, phi_dot
            B[row, axis] = u
        H[axis, 4 + axis] = 1.0
        H[2 + axis, [2 + axis, axis]] = 1.0, -1.0
    for row, axis, sign in ((4, 1, -1.0), (5, 0, 1.0)):  # y_x sees what y does, and the other way round
        H[row, [axis, 4 + axis, 6 + axis]] = [sign * value for value in ACCEL[:3]]
        D[row, axis] = sign * ACCEL[3]
    return np.eye(8) + DT_S * A, DT_S * B, H, D


def measurements(log: Log, T_ob: np.ndarray) -> np.ndarray:
    sensors = log[names.SENSORS]
    wheels = WHEEL_RAD * sensors["encoder_counts"][:, :3]
    ball = WHEEL_RADIUS_M / BALL_RADIUS_M * (wheels - wheels[0]) @ T_ob.T
    gyro = GYRO_RAD_S * sensors["gyro_counts"][:, :2]
    gravity_less_acceleration = -ACCEL_M_S2 * sensors["accel_counts"][:, :2]
    return np.column_stack([gyro, ball[:, :2], gravity_less_acceleration])


def steady_gain(F: np.ndarray, H: np.ndarray) -> np.ndarray:
    P = np.eye(8) * 1e-4
    for _ in range(3000):
        P = F @ P @ F.T + np.diag(Q)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(R))
        P = (np.eye(8) - K @ H) @ P
    return K


def estimate(log: Log, T_ob: np.ndarray) -> np.ndarray:
    """States over the ticks of the log, with the inputs before compensation, [T] 6.1.

    Its gain is constant, so the filter is linear and time-invariant: one first-order recursion per mode.
    """
    F, G, H, D = model()
    K = steady_gain(F, H)
    y = measurements(log, T_ob)
    u = np.zeros((len(y), 2))
    given = log[names.MOTORS]["u_lin"][: len(y) - 1, :2]
    u[1 : len(given) + 1] = given
    correct = np.eye(8) - K @ H
    poles, modes = np.linalg.eig(correct @ F)
    driven = np.linalg.solve(modes, (u @ (correct @ G - K @ D).T + y @ K.T).T)
    states = [lfilter([1.0], [1.0, -pole], row) for pole, row in zip(poles, driven, strict=True)]
    return (modes @ np.array(states)).real.T
