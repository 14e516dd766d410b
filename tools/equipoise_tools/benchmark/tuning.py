"""Every peer searched with the same budget on robots that do not score; tools/benchmark tune --help."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

from . import runs
from .peers import PEERS, Factors, knobs_of

FIRST_ROBOT = 851
FOUND = Path(__file__).with_name("tuned.json")
LATE, ASTRAY = 0.5, 0.1  # of a fall's cost: what outlasting and a metre from the path are worth


def cost(row: dict) -> float:
    """1 for a robot that is lost at once, little for one that keeps its place to the end."""
    if row["ended"] != "finished":
        return 1.0 - LATE * min((row["fell_at_s"] or 0.0) / runs.DURATION_S, 1.0)
    return ASTRAY * min(row["position_rmse_m"] or 0.0, 1.0)


def training(kind: str, peer: str, robots: int) -> list[runs.Trial]:
    """Every point; robots take turns in the engines."""
    numbers = range(FIRST_ROBOT, FIRST_ROBOT + robots)
    return [
        runs.Trial(robot, kind, peer, point, runs.ENGINES[robot % 2])
        for robot in numbers
        for point in runs.POINTS
    ]


def search(
    kind: str,
    peer: str,
    budget: int,
    robots: int,
    fidelity: str,
    run: Callable[[list, str, Factors], list[dict]],
) -> dict:
    """The best of `budget` choices; the first is the designer's."""
    import optuna

    knobs = knobs_of(PEERS[peer], kind)
    trials = training(kind, peer, robots)

    def objective(trial) -> float:
        factors = {name: trial.suggest_float(name, *bounds, log=True) for name, bounds in knobs.items()}
        rows = run(trials, fidelity, factors)
        value = sum(map(cost, rows)) / len(rows)
        print(f"{kind} {peer} {trial.number + 1}/{budget}: cost {value:.4f}", file=sys.stderr, flush=True)
        return value

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
    study.enqueue_trial(dict.fromkeys(knobs, 1.0))
    study.optimize(objective, n_trials=budget)
    return {
        "factors": {name: round(value, 4) for name, value in study.best_params.items()},
        "cost": round(study.best_value, 4),
        "cost_first": round(study.trials[0].value or 0.0, 4),
        "runs": budget * len(trials),
        "fidelity": fidelity,
    }


def found(path: Path = FOUND) -> dict:
    return json.loads(path.read_text()) if path.exists() else {}


def factors_of(told: dict, kind: str, peer: str) -> Factors:
    """As searched; the designer's where nothing was."""
    if peer in told.get(kind, {}):
        return told[kind][peer]["factors"]
    return dict.fromkeys(PEERS[peer].knobs, 1.0)


def write(told: dict, kind: str, peer: str, result: dict, path: Path = FOUND) -> None:
    told.setdefault(kind, {})[peer] = result
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(told, indent=1, sort_keys=True) + "\n")
    unfinished.rename(path)
