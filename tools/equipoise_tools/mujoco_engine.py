"""MuJoCo behind the production pipeline, in process: our motors, friction and sensors, its rigid bodies.

    build/venv/bin/python -m equipoise_tools.mujoco_engine --in trials.json

`tools/campaign --engine mujoco` hands trials in this form to a process per core; tools/campaign --help.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from equipoise_robot import models
from equipoise_robot.engine import Engine

from .foreign_log import configuration
from .paths import UserError

PUSHES_AT_S = (8.0, 16.0, 24.0)
PUSH_N, PUSH_S = (1.0, 4.0), 0.05
SLOPE_RAD = math.radians(2.0)
SILLS, SILL_M, FIELD_M, CLEAR_M = 100, (1.0, 0.05), 12.0, 0.5  # of length and width; around the start none
SILL_HEIGHT_M = (0.001, 0.002)


def disturbances(seed: int) -> tuple[models.Floor, list[str]]:
    """Pushes, slope and sills of this seed, and what of them the world's own keys say."""
    rng = np.random.default_rng(seed)
    slope, towards = SLOPE_RAD * math.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    pushes = []
    for at_s in PUSHES_AT_S:
        force, angle = rng.uniform(*PUSH_N), rng.uniform(0.0, 2.0 * np.pi)
        pushes.append(
            f"{{at_s={at_s}, duration_s={PUSH_S}, "
            f"force_N=[{force * math.cos(angle):.6f}, {force * math.sin(angle):.6f}]}}"
        )
    sills: list[tuple[float, float, float, float, float, float]] = []
    while len(sills) < SILLS:
        x, y = rng.uniform(-FIELD_M / 2, FIELD_M / 2, 2)
        angle, height = rng.uniform(0.0, np.pi), rng.uniform(*SILL_HEIGHT_M)
        if math.hypot(x, y) > CLEAR_M + SILL_M[0] / 2:
            sills.append((x, y, angle, *SILL_M, height))
    floor = models.Floor((slope * math.cos(towards), slope * math.sin(towards)), sills)
    return floor, [f"pushes=[{', '.join(pushes)}]"]


@functools.cache
def no_random_pushes(config: str, fidelity: str) -> tuple[str, ...]:
    """The floor says what pushes the robot; a world that has pushes of its own goes without."""
    table = f"world.{fidelity}.random_pushes"
    return (f"{table}.every_s=0",) if table in configuration(Path(config)) else ()


def run(trial: dict, config: str, settings: list[str], controller: Callable | None = None) -> dict:
    """One trial as `equipoise trials` has it, on a calm or a disturbed floor; `controller`: one's own."""
    from equipoise_robot import _core

    floor, world = (
        disturbances(trial["seed"]) if trial["floor"] == "disturbed" else (models.Floor(), ["pushes=[]"])
    )
    request = _core.Request()
    request.config, request.seed, request.robot_number = config, trial["seed"], trial["robot"]
    request.fidelity = trial.get("fidelity", "full")
    request.estimator, request.controller = trial.get("estimator", ""), trial.get("controller", "")
    request.yaw_rate_rad_s, request.drive_mps = 2.0 * np.pi * trial["yaw_hz"], trial["drive_mps"]
    request.duration_s = trial["duration_s"]
    request.set = [f"world.{request.fidelity}.{text}" for text in world]
    request.set += [*no_random_pushes(config, request.fidelity), *settings]
    robot = _core.robot_type(config)

    def make(dimensions: str, inputs: np.ndarray, outputs: np.ndarray):
        engine = Engine(models.mjcf(robot, json.loads(dimensions), floor), inputs, outputs)
        return engine.start, engine.step

    return json.loads(_core.run_in_engine(request, make, controller))


def judged(trial: dict, config: str, settings: list[str], twins: bool) -> dict:
    row = run(trial, config, settings)
    twin_stands = not run(trial, config, [*settings, "safety.detection=false"])["fell"] if twins else None
    row["off_though_it_stands"] = row["ended"] == "disarmed" and twin_stands if twins else None
    row["saved_by_detector"] = not row["fell"] and not twin_stands if twins else None
    return {**row, **trial}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.mujoco_engine", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--config", required=True)
    parser.add_argument("--in", dest="trials", type=Path, required=True, help='{"trials": [...]}')
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--twins", action="store_true")
    given = parser.parse_args()
    try:
        trials = json.loads(given.trials.read_text())["trials"]
        rows = [judged(trial, given.config, given.set, given.twins) for trial in trials]
    except (UserError, OSError, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    json.dump({"trials": rows}, sys.stdout)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
