"""How fast the environments step on all cores: robot time per second.

Resets, each a second under the robot's own feedback, are counted apart. Zero drive for a quarter of a second
from standing: no robot has fallen by then. A run takes its number of episodes, default 20.
"""

import sys
import time

import equipoise_robot.envs  # noqa: F401  names the environments
import gymnasium
import numpy as np

STEPS = 50


def measured(robot, count, episodes):
    envs = gymnasium.make_vec(f"Equipoise-{robot}-v0", num_envs=count)
    actions = np.zeros(envs.action_space.shape)
    reset_s = step_s = 0.0
    for episode in range(episodes):
        begun = time.perf_counter()
        envs.reset(seed=1 + episode * count)
        standing = time.perf_counter()
        for _ in range(STEPS):
            lost = envs.step(actions)[2]
        step_s += time.perf_counter() - standing
        reset_s += standing - begun
        assert not lost.any()
    steps = episodes * STEPS * count
    return steps / step_s, 1e3 * reset_s / (episodes * count)


episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 20
for robot in ("Mbbr", "Mip"):
    for count in (1, 16):
        per_s, reset_ms = measured(robot, count, episodes)
        print(
            f"{robot}, {count} robots: {per_s:.0f} steps per second,"
            f" {per_s * 0.005:.0f} times real time; a reset {reset_ms:.1f} ms"
        )
