"""Approximate Bayesian computation: which parameters make a simulation come near to what is printed.

Adaptive population Monte Carlo (Lenormand, Jabot, Deffuant 2013): draws from the prior, of which the nearest
are kept, weighted and moved; the next generation's draws begin from them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

STIR = 0.2  # of the draws, choices are drawn anew


@dataclass(frozen=True)
class Parameter:
    """`low` to `high`, uniform, of the logarithm if `log`; whole numbers if `whole`; or one of `choices`."""

    name: str
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    whole: bool = False
    choices: tuple[str, ...] = ()
    unit: str = ""

    def value(self, share: float) -> float | str:
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        if self.log:
            return self.low * (self.high / self.low) ** share
        if self.whole:
            return min(math.floor(self.low + share * (self.high - self.low + 1)), int(self.high))
        return self.low + share * (self.high - self.low)


class Row(Protocol):
    """What is printed of one condition: quantities, and how far a run is from them."""

    name: str

    def quantities(self) -> tuple[str, ...]: ...

    def off(self, quantity: str, ran: dict) -> float: ...


@dataclass
class Draw:
    shares: list[float]  # each parameter's place in its range
    ran: dict[str, dict]
    weight: float = 1.0
    distance: float = math.inf


@dataclass
class Inference:
    """`run(values, seed)` gives {row: quantities}."""

    parameters: tuple[Parameter, ...]
    rows: tuple[Row, ...]
    run: Callable[[dict, int], dict[str, dict]]
    size: int = 60
    keep: int = 20
    seed: int = 1
    jobs: int = 1
    draws: list[Draw] = field(default_factory=list)  # all, in the order of drawing

    @property
    def kept(self) -> list[Draw]:
        return sorted(self.draws, key=lambda d: d.distance)[: self.keep]

    def values(self, shares: list[float]) -> dict:
        return {p.name: p.value(s) for p, s in zip(self.parameters, shares, strict=True)}

    def distance(self, ran: dict[str, dict], without: str = "") -> float:
        rows = [row for row in self.rows if row.name != without]
        return float(np.mean([row.off(q, ran[row.name]) for row in rows for q in row.quantities()]))

    def _moved(self, rng: np.random.Generator, kept: list[Draw], spread: np.ndarray) -> list[float]:
        at = np.array(kept[rng.choice(len(kept), p=weights_of(kept))].shares)
        moved = np.full(at.size, -1.0)
        for i, parameter in enumerate(self.parameters):
            if parameter.choices:
                moved[i] = rng.random() if rng.random() < STIR else at[i]
            while not 0 <= moved[i] < 1:
                moved[i] = at[i] + spread[i] * rng.normal()
        return moved.tolist()

    def _weight(self, shares: list[float], kept: list[Draw], spread: np.ndarray) -> float:
        """Prior over proposal; the prior's density is 1."""
        centres, weights = np.array([d.shares for d in kept]), weights_of(kept)
        density = np.ones(len(kept))
        for i, parameter in enumerate(self.parameters):
            if parameter.choices:
                n = len(parameter.choices)
                same = np.floor(centres[:, i] * n) == np.floor(shares[i] * n)
                density *= STIR + np.where(same, (1 - STIR) * n, 0.0)
            else:
                inside = normal_share(centres[:, i], spread[i])
                off = (shares[i] - centres[:, i]) / spread[i]
                density *= np.exp(-0.5 * off**2) / (math.sqrt(2 * math.pi) * spread[i] * inside)
        return float(1 / (weights @ density))

    def step(self, until: float = math.inf) -> float:
        """A generation, or what of it begins before `until` (monotonic clock); the share that was kept."""
        rng = np.random.default_rng([self.seed, len(self.draws)])
        kept = self.kept
        if len(self.draws) >= self.size:
            fresh = self.size - self.keep
            shares, weights = np.array([d.shares for d in kept]), weights_of(kept)
            variance = weights @ (shares - weights @ shares) ** 2
            spread = np.sqrt(np.maximum(2 * variance, 1e-4))  # of the step: twice the kept draws' variance
            drawn = [self._moved(rng, kept, spread) for _ in range(fresh)]
            weighed = [self._weight(moved, kept, spread) for moved in drawn]
        else:
            fresh = self.size - len(self.draws)
            drawn = rng.random((fresh, len(self.parameters))).tolist()
            weighed = [1.0] * fresh
        first = len(self.draws) + 1

        def one(i: int) -> Draw | None:
            if time.monotonic() >= until:
                return None
            ran = self.run(self.values(drawn[i]), first + i)
            return Draw(drawn[i], ran, weighed[i], self.distance(ran))

        with ThreadPoolExecutor(self.jobs) as pool:
            new = [draw for draw in pool.map(one, range(fresh)) if draw is not None]
        self.draws += new
        last = self.kept[-1].distance if self.draws else math.inf
        return sum(d.distance <= last for d in new) / fresh

    def left_out(self, name: str) -> list[Draw]:
        """What would be kept of all draws if nothing were known of a row."""
        return sorted(self.draws, key=lambda d: self.distance(d.ran, without=name))[: self.keep]


def weights_of(draws: list[Draw]) -> np.ndarray:
    weights = np.array([d.weight for d in draws])
    return weights / weights.sum()


def normal_share(centre: np.ndarray, spread: float) -> np.ndarray:
    """Of a normal step, how much stays in 0 to 1."""
    erf = np.vectorize(math.erf)
    return 0.5 * (erf((1 - centre) / (spread * math.sqrt(2))) - erf(-centre / (spread * math.sqrt(2))))


def quantiles(
    values: list[float], weights: np.ndarray, at: tuple[float, ...] = (0.05, 0.5, 0.95)
) -> list[float]:
    order = np.argsort(values)
    rank = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(q, rank, np.array(values)[order])) for q in at]


def effective(draws: list[Draw]) -> float:
    return float(1 / np.sum(weights_of(draws) ** 2))
