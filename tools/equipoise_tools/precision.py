"""Errors and ends of drawn robots whose filter runs in single and, once more, in double precision.

python3 -m equipoise_tools.precision [--robots N] [--write]: into tests/data/precision.json, from which
tools/count_instructions writes docs/performance.md.
"""

from __future__ import annotations

import argparse
import json
import sys

import numpy as np

from .count_page import PAGE, PRECISION, ROBOTS, performance_page, precision_table
from .entry import leave
from .paths import UserError, repository_root
from .trials import run_trials

ERRORS = ("attitude_rmse_rad", "yaw_frame_speed_rmse_m_s")
QUANTILES = (0.5, 0.95)
RESAMPLED = 4000


def trials(robots: int, first: int, fidelity: str, duration_s: float) -> list[dict]:
    """A seed each; at 0, 1 or 2 Hz, driving or in place."""
    return [
        {
            "robot": number,
            "seed": number,
            "yaw_hz": float(number % 3),
            "drive_mps": 0.1 * (number % 2),
            "duration_s": duration_s,
            "fidelity": fidelity,
        }
        for number in range(first, first + robots)
    ]


def ran(config: str, precision: str, asked: list[dict], jobs: int) -> list[dict]:
    print(f"{config}, {precision}: {len(asked)} runs", file=sys.stderr, flush=True)
    return run_trials(config, asked, {"estimator.ekf.precision": f'"{precision}"'}, jobs)


def compared(single: list[dict], double: list[dict]) -> dict:
    """Ends, and of those who finished in both: quantiles of single over double, less 1, with intervals of
    resampled pairs."""
    both = [(s, d) for s, d in zip(single, double, strict=True) if s["ended"] == d["ended"] == "finished"]
    result: dict = {
        "robots": len(single),
        "finished": {
            "single": sum(s["ended"] == "finished" for s in single),
            "double": sum(d["ended"] == "finished" for d in double),
            "both": len(both),
        },
    }
    if not both:
        return result
    drawn = np.random.default_rng(1).integers(0, len(both), (RESAMPLED, len(both)))
    for error in ERRORS:
        one, two = (np.array([pair[i][error] for pair in both]) for i in (0, 1))
        result[error] = {"ratio_median": round(float(np.median(one / two)) - 1, 5)}
        for share in QUANTILES:
            made = np.quantile(one[drawn], share, axis=1) / np.quantile(two[drawn], share, axis=1)
            middle = np.quantile(one, share) / np.quantile(two, share)
            low, high = np.quantile(made, (0.025, 0.975))
            result[error][f"{share:g}"] = [round(float(v) - 1, 5) for v in (middle, low, high)]
    return result


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="precision", description=__doc__.splitlines()[0], allow_abbrev=False
    )
    parser.add_argument("--robots", type=int, default=1000, help="of each type")
    parser.add_argument("--first", type=int, default=60001, metavar="N", help="number of the first robot")
    parser.add_argument("--fidelity", default="built2025")
    parser.add_argument("--duration-s", type=float, default=30.0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--write", action="store_true", help=f"{PRECISION} and {PAGE}")
    options = parser.parse_args()
    if options.robots < 1:
        parser.error(f"--robots {options.robots}: 1 or more")
    root = repository_root()
    asked = trials(options.robots, options.first, options.fidelity, options.duration_s)
    result: dict = {k: getattr(options, k) for k in ("robots", "first", "fidelity", "duration_s")}
    try:
        for robot, config in ROBOTS.items():
            both = (ran(config, p, asked, options.jobs) for p in ("single", "double"))
            result[robot] = compared(*both)
    except UserError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    print("\n".join(precision_table(result)))
    if options.write:
        (root / PRECISION).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        (root / PAGE).write_text(performance_page(root), encoding="utf-8")
    return 0


if __name__ == "__main__":
    leave(main)
