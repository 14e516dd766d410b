"""Do both engines say the same of the same robots? Calm floor, nothing pushes.

    build/venv/bin/python -m equipoise_tools.agreement --config config/mbbr.toml --first-robot 371

Runs what of both campaigns is missing, then counts equal and different verdicts, and compares errors; and how
the typical robot moves in both.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from . import campaign
from .campaign_page import at_point, points_of, why
from .foreign_log import configuration
from .paths import UserError, repository_root

RUNS = ("0,0.2", "1,0.2", "1.5,0.2", "2,0.2", "3,0.1")
ERRORS = ("attitude_rmse_rad", "yaw_frame_speed_rmse_m_s")
CALM = {
    "": {"pushes": "[]"},
    ".disturbance": {"floor_slope_rad": "[0,0]"},
    ".floor": {"wave_rad": "0", "sill_m": "0", "joint_m": "0"},
    ".random_pushes": {"every_s": "0"},
}


def calm(config: str, fidelity: str) -> list[str]:
    """What makes our engine's floor the one that MuJoCo's calm is."""
    tables = configuration(Path(config))
    return [
        f"world.{fidelity}{table}.{key}={value}"
        for table, keys in CALM.items()
        for key, value in keys.items()
        if key in tables.get(f"world.{fidelity}{table}", {})
    ]


def verdict(row: dict) -> str:
    return why(row) if row["fell"] else "upright"


def compared(own: list[dict], other: list[dict]) -> list[str]:
    there = {campaign.identity(row): row for row in other}
    pairs = [(row, there[campaign.identity(row)]) for row in own if campaign.identity(row) in there]
    lines = [
        f"| yaw Hz, m/s | runs | both upright | both lost | only ours upright | only MuJoCo's | {ERRORS[0]}, "
        f"{ERRORS[1]}: median of MuJoCo's over ours |",
        "|---|---|---|---|---|---|---|",
    ]
    for yaw, drive in points_of(own):
        here = [(a, b) for a, b in pairs if a in at_point(own, (yaw, drive))]
        both = [(a, b) for a, b in here if not a["fell"] and not b["fell"]]
        counts = Counter((a["fell"], b["fell"]) for a, b in here)
        ratios = [np.median([b[key] / a[key] for a, b in both if a[key]] or [np.nan]) for key in ERRORS]
        cells = [counts[False, False], counts[True, True], counts[False, True], counts[True, False]]
        lines.append(
            f"| {yaw:g}, {drive:g} | {len(here)} | {' | '.join(map(str, cells))} | "
            f"{ratios[0]:.2f}, {ratios[1]:.2f} |"
        )
    differ = [(a, b) for a, b in pairs if a["fell"] != b["fell"]]
    lines += ["", f"{len(pairs) - len(differ)} of {len(pairs)} verdicts are the same.", ""]
    for (ours, theirs), n in Counter((verdict(a), verdict(b)) for a, b in differ).most_common():
        robots = [a["robot"] for a, b in differ if (verdict(a), verdict(b)) == (ours, theirs)]
        lines.append(f"- {n}: ours {ours}, MuJoCo's {theirs}; robots {', '.join(map(str, robots[:8]))}")
    return lines


def motion_rms(trial: dict, config: str, settings: list[str], engine: str) -> np.ndarray:
    """Tilt about x and y, rad, and rate of the ball or wheels, rad/s, of the estimate after 5 s."""
    from equipoise_robot import run

    from .mujoco_engine import run as run_in_mujoco

    ticks = []

    def controller(tick):
        at = tick.estimate
        ticks.append((tick.t_s, *at.theta_rad[:2], *at.phi_dot_rad_s))
        return tick.u_own

    path = str(repository_root() / config)
    if engine == "mujoco":
        run_in_mujoco({**trial, "floor": "calm"}, path, settings, controller)
    else:
        other = {"robot_number": trial["robot"], "controller": controller, "set": settings}
        run(path, **{key: value for key, value in trial.items() if key != "robot"}, **other)
    values = np.array(ticks)
    return np.sqrt(np.mean(values[values[:, 0] > 5.0, 1:] ** 2, axis=0))


def typical(config: str, fidelity: str, runs: list[str], seeds: range) -> list[str]:
    """RMS over `seeds`: MuJoCo's over ours, and ours."""
    names = ("tilt x", "tilt y", "rate x", "rate y")
    lines = [f"| typical robot: yaw Hz, m/s | {' | '.join(names)} |", "|---|---|---|---|---|"]
    for text in runs:
        yaw, drive = map(float, text.split(","))
        rms = {}
        for engine, settings in (("own", calm(config, fidelity)), ("mujoco", [])):
            trial = {"robot": 0, "yaw_hz": yaw, "drive_mps": drive, "duration_s": 20.0, "fidelity": fidelity}
            squares = [motion_rms({**trial, "seed": seed}, config, settings, engine) ** 2 for seed in seeds]
            rms[engine] = np.sqrt(np.mean(squares, axis=0))
        pairs = zip(rms["own"], rms["mujoco"], strict=True)
        cells = [f"{there / here:.2f} of {here:.3g}" if here > 0.0 else "-" for here, there in pairs]
        lines.append(f"| {yaw:g}, {drive:g} | {' | '.join(cells)} |")
    return [*lines, ""]


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="agreement", description=__doc__.splitlines()[0])
    parser.add_argument("--config", default="config/mbbr.toml")
    parser.add_argument("--fidelity", default="full")
    parser.add_argument("--first-robot", type=int, default=1)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--runs", nargs="+", default=list(RUNS), metavar="YAW_HZ,M_S")
    parser.add_argument("--duration-s", default="30")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--workers", default="0")
    parser.add_argument("--out", type=Path, default=repository_root() / "build" / "agreement")
    given = parser.parse_args(words)
    common = ["--config", given.config, "--fidelity", given.fidelity, "--runs", *given.runs]
    common += ["--first-robot", str(given.first_robot), "--robots", str(given.robots)]
    common += ["--duration-s", given.duration_s, "--workers", given.workers]
    rows = []
    try:
        for engine, floor in (("own", calm(given.config, given.fidelity)), ("mujoco", [])):
            out = given.out / engine
            settings = [word for text in [*floor, *given.set] for word in ("--set", text)]
            if campaign.main([*common, "--engine", engine, "--out", str(out), *settings]) != 0:
                return 1
            rows.append(campaign.read_parts(out))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join([*typical(given.config, given.fidelity, given.runs, range(1, 5)), *compared(*rows)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
