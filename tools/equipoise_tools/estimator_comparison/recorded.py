"""Recorded runs as the filters get them: on one time base, from the last tick that the robot was held."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from time import process_time

import equipoise_robot as eq
import numpy as np

from .model import DT, ROWS, Model, N, Robot, robot_of

SETTLED_S = 5.0  # errors count from here, as everywhere
REST_BLOCK, REST_TICKS, REST_TURNS, REST_SIGMAS, REST_LARGEST = (
    25,
    400,
    0.02,
    4.0,
    np.radians(11.0),
)  # rest_bias.hpp
STILL = 6  # freshness.hpp: an axis that repeats its count so often is left out


@dataclass
class Recording:
    """One run of one robot, a row per tick; samples calibrated, as its estimator got them."""

    robot_number: int
    yaw_hz: float
    drive_mps: float
    fidelity: str
    ended: str
    config: dict
    t_s: np.ndarray
    held: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    wheels: np.ndarray
    u: np.ndarray
    own: np.ndarray  # the firmware's estimate: tilt x y, ball rates x y, heading
    own_nis: np.ndarray
    truth: np.ndarray  # the same of the plant


def _five(theta: np.ndarray, phi_dot: np.ndarray) -> np.ndarray:
    return np.concatenate([theta[:, :2], phi_dot, theta[:, 2:]], axis=1)


def record(
    robot_number: int, yaw_hz: float, drive_mps: float, duration_s: float, seed: int, settings=None, **more
) -> Recording:
    """The default filter runs, in double precision as those beside it; the function only listens."""
    heard: list[tuple] = []
    sound: list[bool] = []

    def listen(tick: eq.EstimatorTick) -> eq.State:
        imu = (*tick.gyro_B_rad_s, *tick.accel_B_m_s2)
        heard.append((tick.t_s, tick.held, *imu, *tick.wheel_angle_rad, *tick.u))
        sound.append(tick.imu_ok and tick.encoders_ok)
        return tick.own

    run = eq.run(
        "mbbr",
        yaw_hz=yaw_hz,
        drive_mps=drive_mps,
        duration_s=duration_s,
        seed=seed,
        robot_number=robot_number,
        estimator=listen,
        record=True,
        set={"estimator.ekf.precision": "double", **(settings or {})},
        **more,
    )
    if not all(sound) or run.degraded:
        raise eq.UserError(f"robot {robot_number}: samples are missing; a comparison needs all")
    table = np.array(heard, float)
    states = {name: run.log[f"EQUIPOISE_{name}"] for name in ("STATE", "TRUTH")}
    five = {name: _five(s["theta_rad"], s["phi_dot_rad_s"]) for name, s in states.items()}
    return Recording(
        robot_number,
        yaw_hz,
        drive_mps,
        run.fidelity,
        run.ended,
        tomllib.loads(run.log.run.config_toml),
        table[:, 0],
        table[:, 1] > 0,
        *(table[:, i : i + 3] for i in (2, 5, 8, 11)),
        own=five["STATE"],
        own_nis=states["STATE"]["normalized_innovation"],
        truth=five["TRUTH"],
    )


def rest_bias(gyro: np.ndarray) -> np.ndarray:
    """Mean over the last stretch of rest."""
    mean, bias, samples = np.zeros(3), np.zeros(3), 0
    for start in range(0, len(gyro) - REST_BLOCK + 1, REST_BLOCK):
        block = gyro[start : start + REST_BLOCK]
        here = block.mean(0)
        noise = np.sqrt((np.diff(block, axis=0) ** 2).sum(0) / (2 * (REST_BLOCK - 1)))
        tolerance = REST_TURNS + REST_SIGMAS * np.sqrt(2 / REST_BLOCK) * noise
        same = samples > 0 and bool((abs(here - mean) < tolerance).all())
        samples = min(samples + REST_BLOCK, REST_TICKS) if same else REST_BLOCK
        if not (abs(here) - tolerance < REST_LARGEST).all():
            samples = 0
        if samples <= REST_BLOCK:
            mean = here
        else:
            mean = mean + (here - mean) * REST_BLOCK / samples
            bias = mean
    return bias


def moving(gyro: np.ndarray) -> np.ndarray:
    """Where an axis has not repeated its count too often."""
    ok = np.ones(gyro.shape, bool)
    still = np.zeros(3, int)
    for k in range(1, len(gyro)):
        still = np.where(gyro[k] == gyro[k - 1], still + 1, 0)
        ok[k] = still < STILL
    return ok


@dataclass
class Samples:
    """Of many runs, ticks first: what acted and stood at the filter's instant, and what to judge by."""

    robot: Robot
    x0: np.ndarray  # (states, runs)
    acted: np.ndarray  # (ticks, 3, runs)
    latest: np.ndarray  # input from the filter's instant to the tick
    y: np.ndarray  # (ticks, rows, runs)
    use: np.ndarray  # the same shape
    t_s: np.ndarray  # (ticks,)
    truth: np.ndarray  # (ticks, 5, runs)
    own: np.ndarray
    own_nis: np.ndarray  # (ticks, runs)
    ahead_s: float


def samples_of(runs: Iterable[Recording], **changed: float) -> Samples:
    """`changed`: parameters that the filters are told wrongly."""
    runs = list(runs)
    robot = robot_of(runs[0].config, runs[0].fidelity, **changed)
    part = robot.age_s / DT
    if not 0.0 <= part < 1.0:
        raise eq.UserError(f"chain.gyro_delay_s: {robot.age_s} s; this comparison knows ages below a tick")
    axes = Model(robot).robot.T_ob
    ratio = robot.value("r_w") / robot.value("r")
    columns = []
    for f in runs:
        start = int(np.flatnonzero(f.held)[-1])
        if f.held[: start + 1].sum() != start + 1:
            raise eq.UserError(f"robot {f.robot_number}: its motors went off in between")
        x0 = np.zeros(N)
        x0[:2] = f.own[start, :2]  # held: from the averaged accelerometer
        x0[2:5] = ratio * axes @ f.wheels[start] + [*x0[:2], 0.0]
        bias = rest_bias(f.gyro[: start + 1])
        x0[12:14] = bias[:2]
        u, wheels = f.u[start:].copy(), f.wheels[start:]
        u[0] = 0.0
        y = np.empty((len(u) - 1, ROWS))
        y[:, :3] = f.gyro[start + 1 :] - [0.0, 0.0, bias[2]]
        y[:, 3:6] = wheels[1:] + part * (wheels[:-1] - wheels[1:])
        y[:, 6:] = f.accel[start + 1 :, :2]
        use = np.ones_like(y)
        use[:, :3] = moving(f.gyro)[start + 1 :]
        acted = (1.0 - part) * u[1:] + part * u[:-1]
        judged = (a[start + 1 :] for a in (f.t_s, f.truth, f.own, f.own_nis))
        columns.append((x0, acted, u[1:], y, use, *judged))
    if len({len(c[1]) for c in columns}) > 1:
        raise eq.UserError("runs of different lengths: one of them ended early")
    stacked = (np.stack(c, axis=-1) for c in zip(*columns, strict=True))
    x0, acted, latest, y, use, t_s, truth, own, own_nis = stacked
    return Samples(robot, x0, acted, latest, y, use, t_s[:, 0], truth, own, own_nis, part * DT)


@dataclass
class Estimates:
    five: np.ndarray  # (ticks, 5, runs), as Recording.own
    nu: np.ndarray  # (ticks, rows, runs): whitened innovations
    seconds: float = 0.0  # of the processor


def run_filter(kind, samples: Samples, ticks: int | None = None, tilt_offset=(0.0, 0.0)) -> Estimates:
    """Over the recorded samples; tilt_offset: how wrong the start is."""
    x0 = samples.x0.copy()
    x0[:2] += np.asarray(tilt_offset)[:, None]
    filter_ = kind(Model(samples.robot), x0)
    count = len(samples.y) if ticks is None else ticks
    five = np.empty((count, 5, x0.shape[1]))
    nu = np.empty((count, ROWS, x0.shape[1]))
    began = process_time()
    for k in range(count):
        filter_.predict(samples.acted[k])
        filter_.update(samples.acted[k], samples.y[k], samples.use[k])
        tilt, ball, heading = filter_.now(samples.latest[k], samples.ahead_s)
        five[k, :2], five[k, 2:4], five[k, 4] = tilt, ball, heading
        nu[k] = filter_.nu
    return Estimates(five, nu, process_time() - began)
