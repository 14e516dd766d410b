"""Noise and weights tuned by Optuna on training robots, reported on others; see tools/tune --help.

A choice is judged by simulated runs alone: a fall costs more than any error, and weights whose loop
misses the margins of `equipoise design` are not run at all.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .campaign import RUNS, pair
from .campaign_statistics import quantile_interval, wilson
from .paths import UserError, binary, repository_root
from .tuned_run import NotRun, Runs

FALL_COSTS = 100.0
# An error that costs 1: what docs/as-built.md aims at for the median robot.
WORTH = {
    "mbbr": {"attitude_rmse_rad": 0.005, "yaw_frame_speed_rmse_m_s": 0.01},
    "mip": {"attitude_rmse_rad": 0.005, "wheel_speed_rmse_rad_s": 0.1},
}


@dataclass(frozen=True)
class Knob:
    """Elements of one key that are scaled together; `indexes` empty: the key is a number."""

    name: str
    key: str
    indexes: tuple[int, ...]
    low: float
    high: float


KNOBS = {
    "mbbr": (
        Knob("gyro", "estimator.ekf.r", (0, 1, 2), 0.1, 10.0),
        Knob("wheels", "estimator.ekf.r", (3, 4, 5), 0.1, 10.0),
        Knob("accelerometer", "estimator.ekf.r", (6, 7), 0.1, 10.0),
        Knob("rates", "estimator.ekf.q", (5, 6, 7, 8, 9), 0.1, 10.0),
        Knob("mount", "estimator.ekf.q", (10, 11), 0.1, 10.0),
        Knob("disturbance", "estimator.ekf.q", (15, 16, 17), 0.1, 10.0),
        Knob("torque", "estimator.ekf.input_variance", (0, 1, 2), 0.1, 10.0),
        Knob("weight of tilt", "controller.scheduled.design.theta_rad", (), 0.7, 1.4),
        Knob("weight of travel", "controller.scheduled.design.phi_rad", (), 0.7, 1.4),
        Knob("weight of tilt rate", "controller.scheduled.design.body_rate_rad_s", (), 0.7, 1.4),
    ),
    "mip": (
        Knob("gyro", "estimator.ekf.r", (0, 1, 2), 0.1, 10.0),
        Knob("wheels", "estimator.ekf.r", (3, 4), 0.1, 10.0),
        Knob("accelerometer", "estimator.ekf.r", (5,), 0.1, 10.0),
        Knob("rates", "estimator.ekf.q", (3, 4, 5), 0.1, 10.0),
        Knob("torque", "estimator.ekf.input_variance", (0, 1), 0.1, 10.0),
        Knob("crossover", "controller.slc.design.gain_U", (), 0.9, 1.1),
        Knob("outer loop", "controller.slc.design.outer_gain_pp_a", (), 0.7, 1.4),
    ),
}


def value_at(config: dict, key: str):
    for word in key.split("."):
        config = config[word]
    return config


def settings(config: dict, knobs: tuple[Knob, ...], factors: dict[str, float]) -> list[str]:
    """--set words for the shipped values times the factors."""
    changed: dict[str, object] = {}
    for knob in knobs:
        value = changed.get(knob.key, value_at(config, knob.key))
        factor = factors[knob.name]
        if knob.indexes:
            value = [x * factor if i in knob.indexes else x for i, x in enumerate(value)]
        else:
            value = value * factor
        changed[knob.key] = value
    return [f"{key}={json.dumps(value)}" for key, value in changed.items()]


def cost(rows: list[dict], worth: dict[str, float]) -> float:
    """Mean over the runs of the squared errors, each over what it is worth; a fall counts FALL_COSTS."""
    total = 0.0
    for row in rows:
        if row["fell"]:
            total += FALL_COSTS
        else:
            total += sum((row[name] / scale) ** 2 for name, scale in worth.items())
    return total / len(rows)


def compare(shipped: list[dict], tuned: list[dict], worth: dict[str, float]) -> dict:
    """Both on the same robots: share upright, errors, and the ratio of each robot's errors, run by run."""
    out: dict = {}
    for name, rows in (("shipped", shipped), ("tuned", tuned)):
        upright = sum(not row["fell"] for row in rows)
        out[name] = {"upright": upright, "of": len(rows), "interval": wilson(upright, len(rows))}
        for error in worth:
            values = np.array([row[error] for row in rows if not row["fell"]])
            out[name][error] = {"median": float(np.median(values)), "p95": float(np.quantile(values, 0.95))}
    for error in worth:
        ratios = np.array(
            [
                b[error] / a[error]
                for a, b in zip(shipped, tuned, strict=True)
                if not a["fell"] and not b["fell"]
            ]
        )
        out.setdefault("ratio", {})[error] = dict(
            zip(("median", "low", "high"), quantile_interval(ratios, 0.5), strict=True)
        )
    return out


def study(given: argparse.Namespace, judged: Runs, config: dict, robot: str):
    import optuna

    knobs = KNOBS[robot]
    training = range(1, given.training + 1)

    def objective(trial) -> float:
        factors = {knob.name: trial.suggest_float(knob.name, knob.low, knob.high, log=True) for knob in knobs}
        words = settings(config, knobs, factors)
        try:
            judged.check_margins(words)
        except NotRun as reason:
            trial.set_user_attr("not_run", str(reason))
            raise optuna.TrialPruned from reason
        return cost(judged.run(training, words), WORTH[robot])

    def show(done, trial) -> None:
        what = f"cost {trial.value:.4f}" if trial.value is not None else trial.user_attrs.get("not_run", "")
        best = f"{done.best_value:.4f}" if done.best_trials else "none"
        print(f"{trial.number + 1}/{given.trials}: {what}; best {best}", file=sys.stderr, flush=True)

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    done = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=given.seed))
    done.enqueue_trial({knob.name: 1.0 for knob in knobs})  # as shipped
    done.optimize(objective, n_trials=given.trials, callbacks=[show])
    return done


def table(rows: list[tuple]) -> str:
    head, *rest = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join([head, "|" + "---|" * len(rows[0]), *rest])


def page(told: dict) -> str:
    held = told["held_out"]
    errors = list(WORTH[told["robot"]])
    lines = [
        f"# Tuning of the {told['robot']}: noise and weights by Optuna",
        f"Written by `tools/tune`. {told['trials']} choices, {told['not_run']} of which have",
        "less margin than aimed at and than the shipped one and were not run;",
        f"the others by the training robots 1 to {told['training']} at",
        f"{told['points']}, {told['duration_s']:g} s, world `{told['fidelity']}`.",
        "Cost: mean squared error over "
        + ", ".join(f"{name} {scale:g}" for name, scale in WORTH[told["robot"]].items())
        + f"; a fall {FALL_COSTS:g}. Shipped {told['cost_shipped']:.4f}, best {told['cost_tuned']:.4f}.",
        "",
        table(
            [
                ("what", "shipped times"),
                *((name, f"{factor:.3g}") for name, factor in told["factors"].items()),
            ]
        ),
        "",
        f"## Held out: robots {held['first']} to {held['last']}, which chose nothing",
        table(
            [
                ("", "shipped", "tuned"),
                (
                    "upright (95 %)",
                    *(
                        f"{held[n]['upright']} of {held[n]['of']} ({100 * held[n]['interval'][0]:.1f} to "
                        f"{100 * held[n]['interval'][1]:.1f} %)"
                        for n in ("shipped", "tuned")
                    ),
                ),
                *(
                    (
                        f"{e}, median / p95",
                        *(
                            f"{held[n][e]['median']:.5f} / {held[n][e]['p95']:.5f}"
                            for n in ("shipped", "tuned")
                        ),
                    )
                    for e in errors
                ),
            ]
        ),
        "",
        *(
            f"Run by run, tuned over shipped, {e}: median {held['ratio'][e]['median']:.3f} "
            f"(95 %: {held['ratio'][e]['low']:.3f} to {held['ratio'][e]['high']:.3f})."
            for e in errors
        ),
        "",
        "As `--set`:",
        "",
        "```",
        *told["set"],
        "```",
    ]
    return "\n".join(lines) + "\n"


def arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/tune", description=__doc__.splitlines()[0])
    parser.add_argument("--config", default="config/mbbr.toml")
    parser.add_argument("--training", type=int, default=16, help="robots 1 to N choose")
    parser.add_argument("--held-out", type=int, default=100, help="robots that judge")
    parser.add_argument("--first-held-out", type=int, default=4001)
    parser.add_argument("--trials", type=int, default=80)
    parser.add_argument("--runs", nargs="+", type=pair, default=[pair(RUNS[0]), pair(RUNS[2]), pair(RUNS[5])])
    parser.add_argument("--duration-s", type=float, default=20.0)
    parser.add_argument("--fidelity", default="built2025")
    parser.add_argument("--seed", type=int, default=1, help="of the search")
    parser.add_argument("--out", type=Path, default=repository_root() / "build" / "tune")
    given = parser.parse_args(words)
    if min(given.training, given.held_out, given.trials) < 1 or given.first_held_out <= given.training:
        parser.error("numbers must be 1 or more, and the robots that judge others than those that choose")
    if given.duration_s < 10.0:
        parser.error("--duration-s: 10 or more; errors count after 5 s")
    return given


def main(words: list[str] | None = None) -> int:
    given = arguments(words)
    try:
        path = Path(given.config)
        path = path if path.exists() else repository_root() / given.config
        try:
            config = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, tomllib.TOMLDecodeError) as error:
            raise UserError(f"{path}: {error}") from None
        robot = config.get("robot", {}).get("type", "")
        if robot not in KNOBS:
            raise UserError(f"{path}: robot.type {robot!r}: the knobs of {', '.join(KNOBS)} are known")
        with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
            judged = Runs(binary(), path, given.runs, given.duration_s, given.fidelity, Path(folder))
            done = study(given, judged, config, robot)
            words_of_best = settings(config, KNOBS[robot], done.best_params)
            judges = range(given.first_held_out, given.first_held_out + given.held_out)
            held = compare(judged.run(judges, []), judged.run(judges, words_of_best), WORTH[robot])
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\ninterrupted: nothing was written", file=sys.stderr)
        return 1
    told = {
        "robot": robot,
        "trials": len(done.trials),
        "not_run": sum(trial.value is None for trial in done.trials),
        "training": given.training,
        "points": ", ".join(f"({yaw:g} Hz, {drive:g} m/s)" for yaw, drive in given.runs),
        "duration_s": given.duration_s,
        "fidelity": given.fidelity,
        "cost_shipped": done.trials[0].value,
        "cost_tuned": done.best_value,
        "factors": done.best_params,
        "set": words_of_best,
        "held_out": {"first": judges[0], "last": judges[-1], **held},
    }
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / f"{robot}.json").write_text(json.dumps(told, indent=2) + "\n")
    (given.out / f"{robot}.md").write_text(page(told))
    print(given.out / f"{robot}.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
