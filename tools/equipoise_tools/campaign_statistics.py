"""What a campaign says: intervals of a share; which imperfection separates fallen from upright."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Z95 = 1.959963984540054


def wilson(successes: int, trials: int, z: float = Z95) -> tuple[float, float]:
    """Confidence interval of a share."""
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    return max(0.0, middle - half), min(1.0, middle + half)


def quantile_interval(values: np.ndarray, share: float, z: float = Z95) -> tuple[float, float, float]:
    """Quantile of a sample and its confidence interval by order statistics: no distribution is assumed."""
    ordered = np.sort(values)
    n = len(ordered)
    half = z * math.sqrt(n * share * (1 - share))
    low = max(math.floor(n * share - half), 0)
    high = min(math.ceil(n * share + half), n - 1)
    return float(np.quantile(ordered, share)), float(ordered[low]), float(ordered[high])


def ranks(values: np.ndarray) -> np.ndarray:
    """1 for the smallest; equal values share the mean of their ranks."""
    order = np.argsort(values, kind="stable")
    result = np.empty(len(values))
    result[order] = np.arange(1, len(values) + 1)
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.bincount(inverse, weights=result) / counts)[inverse]


def separation(values: np.ndarray, fell: np.ndarray) -> tuple[float, float]:
    """(A, z): the chance that a fallen robot has the larger value, and how many standard deviations from 1/2.

    Mann and Whitney's statistic; A of 0.5 says that the value does not matter.
    """
    n, m = int(fell.sum()), int((~fell).sum())
    if n == 0 or m == 0:
        return 0.5, 0.0
    a = (ranks(values)[fell].sum() - n * (n + 1) / 2) / (n * m)
    return float(a), float((a - 0.5) / math.sqrt((n + m + 1) / (12 * n * m)))


@dataclass
class Influence:
    name: str
    measure: str  # "value" or "size": the sign may not matter
    effect: float  # chance that the worse has more of it
    z: float


def influences(drawn: dict[str, np.ndarray], worse: np.ndarray) -> list[Influence]:
    """Of every drawn imperfection, the strongest first. `worse`: those to tell from the others."""
    found = []
    for name, values in drawn.items():
        value = Influence(name, "value", *separation(values, worse))
        size = Influence(name, "size", *separation(np.abs(values - np.median(values)), worse))
        found.append(max(value, size, key=lambda i: abs(i.z)))
    return sorted(found, key=lambda i: -abs(i.z))


def survival_over_time(fell_at_s: np.ndarray, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and the share still upright after each; NaN: did not fall."""
    falls = np.sort(fell_at_s[~np.isnan(fell_at_s)])
    times = np.concatenate(([0.0], falls, [duration_s]))
    left = 1.0 - np.concatenate(([0.0], np.arange(1, len(falls) + 1), [len(falls)])) / max(len(fell_at_s), 1)
    return times, left
