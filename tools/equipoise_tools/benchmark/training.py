"""A policy trained by PPO in our own environments, from random weights; tools/benchmark --help.

Needs tools/requirements-training.txt; what it writes is used with NumPy alone.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import torch
from equipoise_robot.envs import BalanceVectorEnv
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from . import policy
from .runs import config_path

ROBOTS = 1, 900  # none of those that score
EACH = 4  # robots per command
LONGEST = 1600  # ticks
ASTRAY = {
    "phi": 0.1,
    "phi_x": 0.1,
    "phi_y": 0.1,
    "psi": 1.0,
    "theta_z": 1.0,
}  # beside the environment's own reward
ASTRAY_COST = 0.2
ROLLOUT, BATCH, EPOCHS = 128, 512, 8
RATE, GAMMA, FIRST_STD = 5e-4, 0.99, 0.3


class Robots(VecEnv):
    """Groups of robots, a command each, as the learner wants them: a step that only resets is worth
    nothing where the robot was lost, and more of the same where its time was over."""

    def __init__(self, kind: str, fidelity: str, seed: int, engines: list[str]) -> None:
        self.groups = [
            BalanceVectorEnv(
                config_path(kind),
                num_envs=EACH,
                max_episode_steps=LONGEST,
                yaw_hz=yaw_hz,
                drive_mps=drive_mps,
                fidelity=fidelity,
                population=ROBOTS,
                jobs=1,
                engine=engines[i % len(engines)],
            )
            for i, (yaw_hz, drive_mps) in enumerate(policy.COMMANDS[kind])
        ]
        one = self.groups[0]
        self.names, self.first_seed = one.observation_names, seed
        self.scale = policy.scale(self.names)
        self.astray = np.array([ASTRAY.get(name, 0.0) for name in self.names])
        super().__init__(EACH * len(self.groups), one.single_observation_space, one.single_action_space)
        self.over = np.zeros((2, self.num_envs), bool)  # in the last step: lost, out of time
        self.seen = np.zeros((self.num_envs, len(self.names)))
        self.losses, self.worth = 0, 0.0  # since they were last told

    def reset(self) -> np.ndarray:
        seeds = (self.first_seed + 1000 * i for i in range(len(self.groups)))
        self.seen = (
            np.concatenate([g.reset(seed=s)[0] for g, s in zip(self.groups, seeds, strict=True)]) * self.scale
        )
        return self.seen

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = actions

    def step_wait(self):
        told = [g.step(a) for g, a in zip(self.groups, np.split(self.actions, len(self.groups)), strict=True)]
        raw, reward, lost, late = (np.concatenate([row[i] for row in told]) for i in range(4))
        reward -= ASTRAY_COST * np.minimum(np.sum((raw * self.astray) ** 2, axis=1), 1.0)
        before, self.seen = self.seen, raw * self.scale
        was_lost, was_late = self.over
        self.over = np.stack([lost, late])
        reward[was_lost | was_late] = 0.0
        self.losses, self.worth = self.losses + int(lost.sum()), self.worth + float(reward.mean())
        infos: list[dict] = [{} for _ in reward]
        for i in np.flatnonzero(late | was_late | lost | was_lost):
            infos[i]["TimeLimit.truncated"] = bool(late[i] or was_late[i])
            infos[i]["terminal_observation"] = before[i] if was_late[i] else self.seen[i]
        return self.seen, reward, lost | late | was_lost | was_late, infos

    def close(self) -> None:
        pass

    def get_attr(self, name, indices=None):
        return [getattr(self, name, None)] * self.num_envs

    def set_attr(self, name, value, indices=None):
        raise NotImplementedError

    def env_method(self, name, *args, indices=None, **kwargs):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper, indices=None):
        return [False] * self.num_envs


class Said(BaseCallback):
    """Progress on stderr, after each rollout."""

    def __init__(self, kind: str, steps: int) -> None:
        super().__init__()
        self.kind, self.steps, self.since, self.rollouts = kind, steps, time.monotonic(), 0

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self.rollouts += 1
        if self.rollouts % 25 == 0:
            robots = self.training_env
            seconds = time.monotonic() - self.since
            print(
                f"{self.kind}: {self.num_timesteps} of {self.steps} steps, {seconds:.0f} s, "
                f"{robots.losses} lost, reward {robots.worth / (25 * ROLLOUT):.3f}",
                file=sys.stderr,
                flush=True,
            )
            robots.losses, robots.worth = 0, 0.0


def train(kind: str, steps: int, seed: int, fidelity: str, engines: list[str]) -> tuple[policy.Net, float]:
    """And minutes that it took."""
    since = time.monotonic()
    torch.set_num_threads(1)
    robots = Robots(kind, fidelity, seed, engines)
    learner = PPO(
        "MlpPolicy",
        robots,
        learning_rate=lambda left: RATE * max(left, 0.02),
        n_steps=ROLLOUT,
        batch_size=BATCH,
        n_epochs=EPOCHS,
        gamma=GAMMA,
        seed=seed,
        device="cpu",
        policy_kwargs={
            "net_arch": {"pi": [policy.WIDTH] * 2, "vf": [64, 64]},
            "log_std_init": float(np.log(FIRST_STD)),
        },
    )
    learner.learn(steps, callback=Said(kind, steps))
    layers = [
        m
        for m in [*learner.policy.mlp_extractor.policy_net, learner.policy.action_net]
        if hasattr(m, "weight")
    ]
    net = [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in layers]
    return net, (time.monotonic() - since) / 60
