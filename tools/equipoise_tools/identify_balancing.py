"""Rotor inertia, friction, tilt offset and delay of a two-wheeler or ball-bot from a log of it balancing.

Fitted to what the planar model predicts 0.1 s ahead; 95 % intervals from the scatter of stretches of 1 s.
With --check-from-s only what is before is fitted and the rest judges the prediction.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares  # type: ignore[import-untyped]
from scipy.stats import t as student  # type: ignore[import-untyped]

from .entry import leave
from .foreign_log import motion
from .paths import UserError
from .planar_model import STEP_S, Motion, Planar, ahead, driven, of_configuration, states

HORIZON = 20  # steps: 0.1 s
FITTED = {"rotor": 0.01, "coulomb": 0.1, "viscous": 0.1, "delay_s": 0.02}  # with a scale for the solver
LONGEST_DELAY_S = 0.05
BLOCK_S = 1.0
LEAST_BLOCKS = 4
LEAST_R2 = (
    0.5  # of the change of wheel angle in 0.1 s beyond constant rate; below, another model moves the wheels
)
SMOOTH = 10  # steps on each side of a state


@dataclass
class Estimate:
    value: float
    half_width_95: float


@dataclass
class Identification:
    estimates: dict[str, Estimate]
    r_squared: float
    models: list[Planar]


def identify(published: Planar, log: Motion) -> Identification:
    """Raises UserError with the reason when the log does not determine the parameters."""
    found = fitted(published, log)
    if found.r_squared >= LEAST_R2:
        return found
    flipped = {"tilt": {"theta": -log.theta}, "wheels": {"phi": -log.phi}, "drive": {"u": -log.u}}
    tried = {name: fitted(published, replace(log, **sign)).r_squared for name, sign in flipped.items()}
    best = max(tried, key=lambda name: tried[name])
    raise UserError(
        f"R2 of the wheels' acceleration is {found.r_squared:.2f}, at least {LEAST_R2} is needed: "
        + (
            f"the sign of {best} is flipped, with the other one R2 is {tried[best]:.2f}"
            if tried[best] >= LEAST_R2
            else "order or units of tilt, wheels or drive, or the configuration's masses and motor are "
            "wrong, or the drive changes faster than the log's rows show"
        )
    )


def fitted(published: Planar, log: Motion) -> Identification:
    axes = len(log.theta)
    names = [*FITTED, *(f"offset_{'xy'[i]}" for i in range(axes))]
    scale = np.array([*FITTED.values(), *[0.02] * axes])
    begin = states(log, HORIZON, SMOOTH, 2)
    blocks = [(s.at * STEP_S // BLOCK_S).astype(int) for s in begin]
    whole = np.unique(np.concatenate(blocks))
    if len(whole) < LEAST_BLOCKS:
        raise UserError(f"the log balances for {len(whole)} s; at least {LEAST_BLOCKS} s are needed")
    after = [(log.theta[i, s.at + HORIZON], log.phi[i, s.at + HORIZON]) for i, s in enumerate(begin)]
    straight = [p - s.phi - HORIZON * STEP_S * s.phi_dot for s, (_, p) in zip(begin, after, strict=True)]
    if np.sqrt(np.mean(np.square(np.concatenate(straight)))) < 1e-4:
        raise UserError("the wheels never accelerate in this log: nothing to identify")

    def models(x: np.ndarray) -> list[Planar]:
        values = dict(zip(FITTED, x * scale, strict=False))
        return [replace(published, **values, offset=(x * scale)[len(FITTED) + i]) for i in range(axes)]

    def wrong(x: np.ndarray) -> list[np.ndarray]:
        out = []
        for i, (p, s) in enumerate(zip(models(x), begin, strict=True)):
            u = driven(log.u[i], s.at, HORIZON, p.delay_s)
            theta, phi = p.predict(s.theta, s.theta_dot, s.phi, s.phi_dot, u)
            out += [theta - after[i][0], phi - after[i][1]]
        return out

    spread = np.repeat(
        [[np.std(t - s.theta), np.std(d)] for s, (t, _), d in zip(begin, after, straight, strict=True)], 1, 0
    )
    weights = (1.0 / np.maximum(spread, 1e-9)).ravel()

    def residual(x: np.ndarray) -> np.ndarray:
        return np.concatenate([w * e for w, e in zip(weights, wrong(x), strict=True)])

    first = np.array([published.rotor, published.coulomb, published.viscous, 0.01, *[0.0] * axes]) / scale
    low = np.array([0.0, 0.0, 0.0, 0.0, *[-0.5] * axes]) / scale
    high = np.array([np.inf, np.inf, np.inf, LONGEST_DELAY_S, *[0.5] * axes]) / scale
    fit = least_squares(residual, np.clip(first, low, high), bounds=(low, high), loss="soft_l1", f_scale=1.0)
    error = wrong(fit.x)
    r_squared = 1.0 - np.mean(np.square(np.concatenate(error[1::2]))) / np.mean(
        np.square(np.concatenate(straight))
    )
    covariance = sandwich(fit, [b for b in blocks for _ in range(2)], whole)
    half = student.ppf(0.975, len(whole) - 1) * np.sqrt(np.diag(covariance)) * scale
    values = fit.x * scale
    estimates = {n: Estimate(float(v), float(h)) for n, v, h in zip(names, values, half, strict=True)}
    return Identification(estimates, float(r_squared), models(fit.x))


def sandwich(fit: Any, blocks: list[np.ndarray], whole: np.ndarray) -> np.ndarray:
    """Covariance when errors within a block go together: H^-1 (sum of squared scores of blocks) H^-1."""
    # scipy has the loss in its Jacobian, not in its residuals; their product is to be the gradient:
    jacobian, error = fit.jac, fit.fun * (1.0 + np.square(fit.fun)) ** 0.25
    block = np.concatenate(blocks)
    free = np.linalg.pinv(jacobian.T @ jacobian)
    meat = np.zeros_like(free)
    for b in whole:
        score = jacobian[block == b].T @ error[block == b]
        meat += np.outer(score, score)
    return free @ meat @ free * len(whole) / (len(whole) - 1)


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/lab identify", description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument(
        "--map", type=Path, required=True, help="as of equipoise import; gyro and accel are not needed"
    )
    parser.add_argument("--from-s", type=float, default=-np.inf)
    parser.add_argument("--to-s", type=float, default=np.inf)
    parser.add_argument("--check-from-s", type=float, help="fit before, predict after; default: the half")
    parser.add_argument("--json", action="store_true", help="one object on stdout")
    given = parser.parse_args()
    try:
        log, config, t = motion(given.table, given.map)
        log = log.part((t >= given.from_s) & (t < given.to_s))
        used = t[log.used]
        if len(used) == 0:
            raise UserError("no balancing stretch of the map is between --from-s and --to-s")
        split = given.check_from_s if given.check_from_s is not None else used[len(used) // 2]
        published = of_configuration(config)
        found = identify(published, log.part(t < split))
    except UserError as error:
        where = "" if str(given.table) in str(error) else f"{given.table}: "
        print(f"error: {where}{error}", file=sys.stderr)
        return 2
    except KeyError as missing:
        print(f"error: {given.map}: has no {missing}", file=sys.stderr)
        return 2
    rest = log.part(t >= split)
    result: dict[str, Any] = {
        "log": str(given.table),
        "estimates": {n: asdict(e) for n, e in found.estimates.items()},
        "configured": {n: getattr(published, n) for n in FITTED},
        "r_squared": found.r_squared,
        "check_s": float(rest.used.sum() * STEP_S),
        "ahead_configured": ahead([published] * len(log.theta), rest),
        "ahead_identified": ahead(found.models, rest),
    }
    if given.json:
        json.dump(result, sys.stdout)
        return 0
    for name, e in found.estimates.items():
        print(f"{name:10} {e.value:10.4g} +- {e.half_width_95:.2g}, 95 %")
    print(
        f"R2 {found.r_squared:.3f}; 0.1 s ahead in the next {result['check_s']:.1f} s, RMS mrad: tilt, wheels"
    )
    rows = {k: result[f"ahead_{k}"]["model"] for k in ("configured", "identified")}
    rows |= {k: result["ahead_identified"][k] for k in ("persistence", "constant_rate")}
    for title, row in rows.items():
        print(f"  {title:13} {1e3 * row['tilt']:6.1f} {1e3 * row['wheel']:6.1f}")
    return 0


if __name__ == "__main__":
    leave(main)
