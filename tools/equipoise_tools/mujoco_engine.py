"""MuJoCo behind the production pipeline, in process: our motors, friction and sensors, its rigid bodies.

    build/venv/bin/python -m equipoise_tools.mujoco_engine --in trials.json

`tools/campaign --engine mujoco` hands trials in this form to a process per core; tools/campaign --help.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np

from . import mjcf
from .mujoco_client import import_mujoco
from .paths import UserError

PUSHES_AT_S = (8.0, 16.0, 24.0)
PUSH_N, PUSH_S = (1.0, 4.0), 0.05
SLOPE_RAD = math.radians(2.0)
SILLS, SILL_M, FIELD_M, CLEAR_M = 100, (1.0, 0.05), 12.0, 0.5  # of length and width; around the start none
SILL_HEIGHT_M = (0.001, 0.002)


class Engine:
    """The bodies of one robot; `inputs` and `outputs` as _core.run_in_engine has them."""

    def __init__(self, xml: str, inputs: np.ndarray, outputs: np.ndarray) -> None:
        self.mujoco = import_mujoco()
        self.model = self.mujoco.MjModel.from_xml_string(xml)
        self.data = self.mujoco.MjData(self.model)
        for i in range(self.model.nnumeric):
            exact = self.model.numeric(i)
            self.model.body(exact.name.removeprefix("inertia_")).inertia[:] = exact.data
        self.mujoco.mj_setConst(self.model, self.data)
        self.body = self.model.body("robot").id
        self.torque, self.push, self.drag = inputs[:3], inputs[3:5], inputs[5:7]
        self.R_WB, self.gyro, self.force = outputs[:9], outputs[9:12], outputs[12:15]
        self.joint_rate, self.position, self.velocity = outputs[15:18], outputs[18:21], outputs[21:24]
        self.pushed = self.data.xfrc_applied[self.body][:2]
        self.accelerometer = self.data.sensor("accel").data
        self.has_ball = self.model.nq == 11
        ball = self.model.body("ball").id if self.has_ball else self.body
        self.dragged = self.data.xfrc_applied[ball][:2]
        self.back = np.zeros(4)

    def start(self) -> None:
        self.mujoco.mju_mat2Quat(self.data.qpos[3:7], self.R_WB)
        self.mujoco.mj_forward(self.model, self.data)
        self.read()

    def step(self) -> None:
        data, lib = self.data, self.mujoco
        if self.has_ball:  # the engine has the joint in the ball's own axes
            lib.mju_negQuat(self.back, data.qpos[7:11])
            lib.mju_rotVecQuat(data.qfrc_applied[6:9], self.torque, self.back)
        else:
            data.qfrc_applied[6:8] = self.torque[:2]
        self.dragged[:] = self.drag
        if self.has_ball:
            self.pushed[:] = self.push
        else:
            self.pushed[:] += self.push
        lib.mj_step(self.model, data)
        self.read()

    def read(self) -> None:
        data, lib = self.data, self.mujoco
        lib.mju_quat2Mat(self.R_WB, data.qpos[3:7])
        self.gyro[:] = data.qvel[3:6]
        self.force[:] = self.accelerometer
        if self.has_ball:
            lib.mju_rotVecQuat(self.joint_rate, data.qvel[6:9], data.qpos[7:11])
        else:
            self.joint_rate[:2] = data.qvel[6:8]
        self.position[:] = data.qpos[:3]
        self.velocity[:] = data.qvel[:3]


def disturbances(seed: int) -> tuple[mjcf.Floor, list[str]]:
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
    floor = mjcf.Floor((slope * math.cos(towards), slope * math.sin(towards)), sills)
    return floor, [f"pushes=[{', '.join(pushes)}]"]


def run(trial: dict, config: str, settings: list[str]) -> dict:
    """One trial as `equipoise trials` has it, on a calm or a disturbed floor."""
    from equipoise_robot import _core

    floor, world = (
        disturbances(trial["seed"]) if trial["floor"] == "disturbed" else (mjcf.Floor(), ["pushes=[]"])
    )
    request = _core.Request()
    request.config, request.seed, request.robot_number = config, trial["seed"], trial["robot"]
    request.fidelity = trial.get("fidelity", "full")
    request.estimator, request.controller = trial.get("estimator", ""), trial.get("controller", "")
    request.yaw_rate_rad_s, request.drive_mps = 2.0 * np.pi * trial["yaw_hz"], trial["drive_mps"]
    request.duration_s = trial["duration_s"]
    request.set = [f"world.{request.fidelity}.{text}" for text in world] + settings
    build = mjcf.BY_TYPE[_core.robot_type(config)]

    def make(dimensions: str, inputs: np.ndarray, outputs: np.ndarray):
        engine = Engine(build(json.loads(dimensions), floor), inputs, outputs)
        return engine.start, engine.step

    return json.loads(_core.run_in_engine(request, make))


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
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    json.dump({"trials": rows}, sys.stdout)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
