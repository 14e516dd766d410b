"""What a filter's estimates are worth: errors against the truth, innovations against their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..campaign_statistics import quantile_interval
from .model import DT, GROUPS
from .recorded import SETTLED_S, Estimates, Samples

LAGS = 20  # ticks


@dataclass
class Figures:
    """A value per run each; NIS, lag and colour by group of rows."""

    attitude_rad: np.ndarray
    speed_m_s: np.ndarray  # of the ball, in the yaw frame
    heading_rad: np.ndarray  # estimate less truth, at the end
    nis: dict[str, np.ndarray]  # per degree of freedom
    lag: dict[str, np.ndarray]  # correlation of innovations that follow each other
    colour: dict[str, np.ndarray]  # share of the lags outside the 95 % band of white noise


def rms(values: np.ndarray) -> np.ndarray:
    """Over ticks and components, per run."""
    return np.sqrt(np.square(values).mean(axis=(0, 1)))


def correlations(nu: np.ndarray, lags: int = LAGS) -> np.ndarray:
    """(lags, rows, runs) of (ticks, rows, runs)"""
    nu = nu - nu.mean(axis=0)
    power = np.maximum(np.square(nu).sum(axis=0), 1e-300)
    return np.stack([(nu[lag:] * nu[:-lag]).sum(axis=0) / power for lag in range(1, lags + 1)])


def figures(estimates: Estimates, samples: Samples, radius_m: float) -> Figures:
    settled = samples.t_s >= SETTLED_S - DT / 2
    error = estimates.five - samples.truth
    nu = estimates.nu[settled]
    nis, found = np.square(nu).mean(axis=0), correlations(nu)
    outside = np.abs(found) > 1.96 / np.sqrt(len(nu))
    return Figures(
        attitude_rad=rms(error[settled, :2]),
        speed_m_s=radius_m * rms(error[settled, 2:4]),
        heading_rad=error[-1, 4],
        nis={name: nis[rows].mean(axis=0) for name, rows in GROUPS.items()},
        lag={name: found[0, rows].mean(axis=0) for name, rows in GROUPS.items()},
        colour={name: outside[:, rows].mean(axis=(0, 1)) for name, rows in GROUPS.items()},
    )


def spread(values: np.ndarray) -> tuple[float, float, float]:
    """Median, 5 and 95 %."""
    middle, low, high = np.percentile(values, (50, 5, 95))
    return float(middle), float(low), float(high)


def median_interval(values: np.ndarray) -> tuple[float, float, float]:
    """Median and its 95 % interval by order statistics."""
    return quantile_interval(np.asarray(values), 0.5)
