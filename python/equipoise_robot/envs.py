"""Gymnasium environments: a policy in the place of the robot's feedback.

The robot is held, arms and stands up under its own feedback for a second; then every action, a drive of -1 to
1 per wheel, takes the place of the feedback in the production pipeline: friction compensation, bridge
inversion and safety are the firmware's. The observation is what the firmware's feedback gets: errors,
reference minus estimate, and the reference's rates. An action works one tick, 5 ms, after the observation it
answers, as on a robot whose policy runs beside the loop. An episode ends when the robot falls or its safety
stops the motors.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._data import need
from .errors import UserError
from .simulation import request

need("gymnasium", "gym")
import gymnasium  # noqa: E402
from gymnasium.utils.seeding import np_random  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.vector.utils import batch_space  # noqa: E402

Array = NDArray[np.float64]
TICK_HZ = 200
ENGINES = ("own", "mujoco")
_LONGEST_S = 360000.0
_SCALES = {  # errors that cost 1
    "theta": 0.1,
    "theta_x": 0.1,
    "theta_y": 0.1,
    "phi_dot": 10.0,
    "phi_dot_x": 10.0,
    "phi_dot_y": 10.0,
    "psi_dot": 5.0,
    "yaw_rate": 5.0,
}
_ACTION_COST = 0.05


def _engine(name: str, robot: str) -> Callable[[str, Array, Array], Any] | None:
    """What the core builds each episode's bodies by; None: its own."""
    if name not in ENGINES:
        raise UserError(f"engine: {name!r} is none; they are {', '.join(ENGINES)}")
    if name == "own":
        return None
    from .engine import Engine
    from .models import mjcf

    def make(dimensions: str, inputs: Array, outputs: Array) -> Any:
        engine = Engine(mjcf(robot, json.loads(dimensions)), inputs, outputs)
        return engine.start, engine.step

    need("mujoco", "mujoco")
    return make


class _Robots:
    """What both environments share: the simulated robots, spaces, reward."""

    def __init__(
        self,
        robot: str | Path,
        count: int,
        jobs: int,
        population: tuple[int, int] | None,
        asked: dict[str, Any],
        engine: str = "own",
    ):
        self.request = request(robot, duration_s=_LONGEST_S, **asked)
        robot_type = _core.robot_type(self.request.config)
        self.names = _core.observation_names(robot_type)
        weights = [1.0 / _SCALES[name] if name in _SCALES else 0.0 for name in self.names]
        self.episodes = _core.Episodes(
            self.request, count, jobs, weights, _ACTION_COST, _engine(engine, robot_type)
        )
        self.population = population
        # Views of what the core writes; active: in the next step, by the core's will or by ours.
        self.observations, self.rewards = self.episodes.observations, self.episodes.rewards
        self.lost, self.active = self.episodes.lost, self.episodes.active
        # Bounded only by what safety lets pass: an observation outside has ended its episode.
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (len(self.names),), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.episodes.wheels,), np.float64)

    def reset(self, which: list[int], randoms: list[np.random.Generator]) -> None:
        """Each with the next seed of its own generator, and the next robot of a population."""
        numbers = []
        if self.population is not None:
            first, last = self.population
            numbers = [int(random.integers(first, last, endpoint=True)) for random in randoms]
        seeds = [int(random.integers(1 << 63)) for random in randoms]
        self.episodes.reset(which, seeds, numbers)

    def step(self, actions: Array) -> int:
        """Observations, rewards and who is lost, of those that are active; how many of them are lost."""
        return self.episodes.step(np.ascontiguousarray(actions, np.float64))


class BalanceEnv(gymnasium.Env[Array, Array]):
    """One robot."""

    metadata = {"render_modes": [], "render_fps": TICK_HZ}  # noqa: RUF012

    def __init__(
        self,
        robot: str | Path = "mbbr",
        *,
        yaw_hz: float = 0.0,
        drive_mps: float = 0.0,
        fidelity: str = "nominal",
        population: tuple[int, int] | None = None,
        set: dict[str, Any] | tuple[str, ...] = (),
        engine: str = "own",
    ) -> None:
        """population: each episode simulates a robot drawn from these numbers, first to last; with fidelity
        "full". engine: whose rigid bodies and contacts, "own" or "mujoco"."""
        self._robots = _Robots(
            robot,
            count=1,
            jobs=1,
            population=population,
            asked={"yaw_hz": yaw_hz, "drive_mps": drive_mps, "fidelity": fidelity, "set": set},
            engine=engine,
        )
        self.observation_space = self._robots.observation_space
        self.action_space = self._robots.action_space

    @property
    def observation_names(self) -> list[str]:
        return self._robots.names

    @property
    def truth(self) -> _core.State:
        """Where the robot really is."""
        return self._robots.episodes.truth(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=seed)
        self._robots.reset([0], [self.np_random])
        return self._robots.observations[0].copy(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        robots = self._robots
        robots.step(np.reshape(action, (1, -1)))
        return robots.observations[0].copy(), float(robots.rewards[0]), bool(robots.lost[0]), False, {}


class BalanceVectorEnv(gymnasium.vector.VectorEnv[Array, Array, NDArray[Any]]):
    """Many robots, stepped in one call; one that has ended is reset by the next step (Gymnasium's
    NEXT_STEP)."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        robot: str | Path = "mbbr",
        *,
        num_envs: int = 1,
        max_episode_steps: int = 2000,
        yaw_hz: float = 0.0,
        drive_mps: float = 0.0,
        fidelity: str = "nominal",
        population: tuple[int, int] | None = None,
        set: dict[str, Any] | tuple[str, ...] = (),
        jobs: int = 0,
        engine: str = "own",
    ) -> None:
        """jobs: threads that step the robots, 0 for one per core; the results do not depend on it. With
        engine="mujoco" there is one."""
        self.num_envs = num_envs
        self._robots = _Robots(
            robot,
            num_envs,
            jobs,
            population,
            {"yaw_hz": yaw_hz, "drive_mps": drive_mps, "fidelity": fidelity, "set": set},
            engine,
        )
        self._limit = max_episode_steps
        self._now = 0
        self._ends = np.zeros(num_envs, np.int64)  # when each reaches the limit
        self._first_end = 0  # of them
        self._again: list[int] = []  # reset by the next step, not active in it
        self._each = range(num_envs)
        self._random: list[np.random.Generator] = []
        self.single_observation_space = self._robots.observation_space
        self.single_action_space = self._robots.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    @property
    def observation_names(self) -> list[str]:
        return self._robots.names

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + i for i in self._each]
        for i, one in zip(self._each, seeds, strict=True):
            if one is not None or i >= len(self._random):
                self._random[i : i + 1] = [np_random(one)[0]]
        self._robots.reset(list(self._each), self._random)
        self._ends[:] = self._first_end = self._now + self._limit
        self._again = []
        return self._robots.observations.copy(), {}

    def step(
        self, actions: Array
    ) -> tuple[Array, NDArray[Any], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        robots = self._robots
        lost = robots.step(actions)
        self._now += 1
        if lost == 0 and not self._again and self._now < self._first_end:  # as nearly always
            truncated = np.zeros(self.num_envs, bool)
        else:
            truncated = self._ended()
        return robots.observations.copy(), robots.rewards.copy(), robots.lost.copy(), truncated, {}

    def _ended(self) -> NDArray[np.bool_]:
        """Resets what had ended before this step, and notes what has ended with it; who reached the limit."""
        robots = self._robots
        if self._again:
            robots.reset(self._again, [self._random[i] for i in self._again])
            self._ends[self._again] = self._now + self._limit
        truncated = (self._ends <= self._now) & ~robots.lost
        self._again = (robots.lost | truncated).nonzero()[0].tolist()
        robots.active[truncated] = False
        self._first_end = int(self._ends.min())
        return truncated
