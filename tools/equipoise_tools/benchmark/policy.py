"""The policy that `training` made, with NumPy alone, in the place of the feedback behind our estimator.

As in equipoise_robot.envs, whose observations it has: what it answers works a tick later.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
from equipoise_robot import _core
from equipoise_robot.envs import BalanceEnv

from .sensing import Known

FILE = Path(__file__).with_name("policy.json")
WIDTH = 32  # of the two hidden layers, tanh
SCALES = {  # of an observation's numbers, to about 1
    "theta": 5.0,
    "theta_dot": 1.0,
    "theta_z": 1.0,
    "phi": 0.2,
    "phi_dot": 0.1,
    "psi": 1.0,
    "psi_dot": 0.2,
    "yaw_rate": 0.2,
    "reference_phi_dot": 0.1,
    "reference_psi_dot": 0.1,
    "reference_yaw_rate": 0.1,
}
COMMANDS = {  # Hz, m/s; trained with, and held-out robots take turns in them
    "mbbr": ((0.0, 0.0), (0.0, 0.2), (0.0, 0.3), (0.5, 0.2), (1.0, 0.2), (-1.0, 0.2), (2.0, 0.1), (3.0, 0.1)),
    "mip": ((0.0, 0.0), (0.0, 0.2), (0.0, 0.3), (0.5, 0.2), (1.0, 0.2), (-1.0, 0.2), (1.5, 0.1), (2.0, 0.1)),
}
TICKS = 2000  # an episode's, 10 s
Net = list[tuple[np.ndarray, np.ndarray]]  # weights and bias of each layer


def scale(names: list[str]) -> np.ndarray:
    return np.array([SCALES[name.removesuffix("_x").removesuffix("_y")] for name in names])


def told(path: Path = FILE) -> dict:
    return json.loads(path.read_text()) if path.exists() else {}


def write(kind: str, net: Net, about: dict, path: Path = FILE) -> None:
    numbers = np.concatenate([part.ravel() for layer in net for part in layer]).astype("<f2")
    shapes = [weights.shape for weights, _ in net]
    row = {**about, "shapes": shapes, "float16": base64.b64encode(numbers.tobytes()).decode()}
    path.write_text(json.dumps({**told(path), kind: row}, indent=1, sort_keys=True) + "\n")


def read(kind: str, path: Path = FILE) -> Net:
    row, at, net = told(path)[kind], 0, []
    numbers = np.frombuffer(base64.b64decode(row["float16"]), "<f2").astype(float)
    for outputs, inputs in row["shapes"]:
        bias = at + outputs * inputs
        net.append((numbers[at:bias].reshape(outputs, inputs), numbers[bias : bias + outputs]))
        at = bias + outputs
    return net


def action(net: Net, seen: np.ndarray) -> np.ndarray:
    """Drive of each wheel; `seen` is scaled."""
    for weights, bias in net[:-1]:
        seen = np.tanh(weights @ seen + bias)
    weights, bias = net[-1]
    return np.clip(weights @ seen + bias, -1.0, 1.0)


class Policy:
    """As a peer."""

    senses = None  # our estimator's

    def __init__(self, robot: Known, factors: dict[str, float]) -> None:
        self.axes = robot.axes
        self.net, self.scale = read(robot.kind), scale(_core.observation_names(robot.kind))
        self.mix = robot.u_of_drives
        self.u = [0.0] * len(self.mix)

    def __call__(self, tick) -> list[float]:
        wanted = [*tick.reference.phi_dot_rad_s[: self.axes], tick.reference.omega_B_rad_s[2]]
        u, seen = self.u, np.array([*tick.error, *wanted])
        self.u = (self.mix @ action(self.net, self.scale * seen)).tolist()
        return u


def stays_upright(kind: str, config: Path, robot: int, engine: str, fidelity: str) -> bool:
    """An episode of one drawn robot."""
    yaw_hz, drive_mps = COMMANDS[kind][robot % len(COMMANDS[kind])]
    env = BalanceEnv(
        config,
        yaw_hz=yaw_hz,
        drive_mps=drive_mps,
        fidelity=fidelity,
        population=(robot, robot),
        engine=engine,
    )
    net, scales = read(kind), scale(env.observation_names)
    seen, _ = env.reset(seed=robot)
    for _ in range(TICKS):
        seen, _, lost, _, _ = env.step(action(net, scales * seen))
        if lost:
            return False
    return True
