"""One run of a peer on a drawn robot: the points, their pushes and faults, the engine."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from equipoise_robot import _core, models
from equipoise_robot.engine import Engine
from equipoise_robot.simulation import request

from ..mujoco_engine import PUSH_N, PUSH_S, no_random_pushes
from ..paths import repository_root
from .peers import PEERS, Factors, choice
from .sensing import known, shipped

DURATION_S, FAULT_AT_S = 12.0, 6.0
PUSHES_AT_S = 5.0, 7.5, 10.0
ENGINES = "own", "mujoco"
CONFIGS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml"}
# Those that a robot may outlive (fault_backend.hpp) and every peer can feel; a robot draws one by its number.
IMU_FAULTS = "imu_gap_100ms", "bad_samples", "noise_burst", "bias_jump", "accel_frozen"
ENCODER_FAULTS = "count_jump", "wheel_loss", "encoder_dead", "encoder_reversal", "encoder_errors"


@dataclass(frozen=True)
class Point:
    name: str
    yaw_hz: dict[str, float]
    drive_mps: float
    pushed: bool = False
    faults: tuple[str, ...] = ()


def everywhere(yaw_hz: float) -> dict[str, float]:
    return dict.fromkeys(CONFIGS, yaw_hz)


POINTS = {
    point.name: point
    for point in (
        Point("drive", everywhere(0.0), 0.2),
        Point("pushes", everywhere(0.0), 0.2, pushed=True),
        Point("turn", everywhere(1.0), 0.2),
        Point("spin", {"mbbr": 3.0, "mip": 2.0}, 0.1),
        Point("IMU fault", everywhere(0.5), 0.2, faults=IMU_FAULTS),
        Point("encoder fault", everywhere(0.5), 0.2, faults=ENCODER_FAULTS),
    )
}


@dataclass(frozen=True, order=True)
class Trial:
    robot: int  # first: a part of the list has every peer on the same robots
    kind: str
    peer: str
    point: str
    engine: str


def pushes(seed: int) -> str:
    """Of this robot, the same in both engines and for every peer."""
    rng = np.random.default_rng(seed)
    told = []
    for at_s in PUSHES_AT_S:
        force, angle = rng.uniform(*PUSH_N), rng.uniform(0.0, 2.0 * np.pi)
        x, y = force * math.cos(angle), force * math.sin(angle)
        told.append(f"{{at_s={at_s}, duration_s={PUSH_S}, force_N=[{x:.6f}, {y:.6f}]}}")
    return f"[{', '.join(told)}]"


def config_path(kind: str) -> Path:
    return repository_root() / CONFIGS[kind]


def asked(trial: Trial, fidelity: str, factors: Factors) -> _core.Request:
    point, path = POINTS[trial.point], config_path(trial.kind)
    peer = PEERS[trial.peer]
    estimator, controller, words = choice(peer, trial.kind, shipped(path), factors)
    words += no_random_pushes(str(path), fidelity)
    words.append(f"world.{fidelity}.pushes={pushes(trial.robot) if point.pushed else '[]'}")
    fault = point.faults[trial.robot % len(point.faults)] if point.faults else ""
    return request(
        path,
        yaw_hz=point.yaw_hz[trial.kind],
        drive_mps=point.drive_mps,
        duration_s=DURATION_S,
        seed=trial.robot,
        robot_number=trial.robot,
        fidelity=fidelity,
        estimator=estimator,
        controller=controller,
        set=words,
        fault=f"{fault}@{FAULT_AT_S:g}" if fault else "",
    )


def run(trial: Trial, fidelity: str, factors: Factors) -> dict:
    """What the run came to, under the names of `equipoise sim`."""
    job = asked(trial, fidelity, factors)
    controller = estimator = None
    make_peer = PEERS[trial.peer].make
    if make_peer is not None:
        controller = make_peer(known(config_path(trial.kind)), factors)
        estimator = controller.senses

    def make(dimensions: str, inputs: np.ndarray, outputs: np.ndarray):
        engine = Engine(models.mjcf(trial.kind, json.loads(dimensions)), inputs, outputs)
        return engine.start, engine.step

    if trial.engine == "mujoco":
        told = json.loads(_core.run_in_engine(job, make, controller, estimator))
    else:
        told = json.loads(_core.run(job, controller, estimator, False, None)[0])
    names = "ended", "reasons", "fell", "fell_at_s", "position_rmse_m", "yaw_rate_mean_hz"
    return {**vars(trial), **{name: told[name] for name in names}}
