"""Peers of the field beside ours on one population, in both engines; see tools/benchmark --help."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from pathlib import Path

from equipoise_robot import _core

from ..campaign import Progress
from ..campaign_statistics import wilson
from ..entry import leave
from ..paths import UserError, commit_and_date, repository_root
from . import picture, policy, runs, score, tuning
from .peers import PEERS, available
from .workers import Workers

KEPT = repository_root() / "docs" / "reports" / "benchmark.json"
PAGE = KEPT.with_suffix(".md")


def trial_of(row: dict) -> runs.Trial:
    return runs.Trial(*(row[name] for name in runs.Trial.__dataclass_fields__))


def read_runs(path: Path) -> list[dict]:
    """What was finished; a last line may be torn."""
    rows = []
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            break
    return rows


def open_folder(out: Path, about: dict) -> list[dict]:
    """The runs that are there already; of this very benchmark or refused."""
    out.mkdir(parents=True, exist_ok=True)
    path, kept = out / "benchmark.json", out / "runs.jsonl"
    if path.exists() and json.loads(path.read_text()) != about:
        raise UserError(f"{out}: holds another benchmark (benchmark.json); give another --out or remove it")
    path.write_text(json.dumps(about, indent=2) + "\n")
    rows = read_runs(kept)
    kept.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return rows


def about_of(given: argparse.Namespace, told: dict) -> dict:
    """What its numbers depend on; the number of robots may grow."""
    shipped = b"".join(runs.config_path(kind).read_bytes() for kind in runs.CONFIGS)
    return {
        "version": _core.version(),
        "configurations_sha256": hashlib.sha256(shipped).hexdigest(),
        "tuned_sha256": hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest(),
        "policy_sha256": hashlib.sha256(policy.FILE.read_bytes()).hexdigest(),
        "fidelity": given.fidelity,
        "first_robot": given.first_robot,
    }


def plan(given: argparse.Namespace) -> list[runs.Trial]:
    numbers = range(given.first_robot, given.first_robot + given.robots)
    return sorted(
        runs.Trial(robot, kind, peer, point, engine)
        for robot in numbers
        for kind in given.kinds
        for peer in given.peers
        for point in given.points
        for engine in given.engines
    )


def benchmark(given: argparse.Namespace) -> list[dict]:
    told = tuning.found()
    rows = open_folder(given.out, about_of(given, told))
    wanted = plan(given)
    done = {trial_of(row) for row in rows}
    jobs = [(t, given.fidelity, tuning.factors_of(told, t.kind, t.peer)) for t in wanted if t not in done]
    progress = Progress(len(wanted), len(wanted) - len(jobs))
    with Workers(given.workers) as workers, (given.out / "runs.jsonl").open("a") as kept:
        for row in workers.rows(jobs):
            kept.write(json.dumps(row) + "\n")
            kept.flush()
            rows.append(row)
            progress.add([row])
    chosen = set(wanted)
    return sorted((row for row in rows if trial_of(row) in chosen), key=trial_of)


def tune(given: argparse.Namespace) -> None:
    told = tuning.found()
    with Workers(given.workers) as workers:
        for kind in given.kinds:
            for peer in given.peers:
                size = given.budget, given.training, given.fidelity
                if tuning.knobs_of(PEERS[peer], kind):
                    tuning.write(told, kind, peer, tuning.search(kind, peer, *size, workers.run))


def train(given: argparse.Namespace) -> None:
    from . import training

    for kind in given.kinds:
        asked = {name: getattr(given, name) for name in ("steps", "seed", "fidelity", "engines")}
        net, minutes = training.train(kind, **asked)
        policy.write(kind, net, {**asked, "minutes": round(minutes, 1)})


def held_out(given: argparse.Namespace) -> None:
    """The policy in our environment, an episode for each robot."""
    for kind in given.kinds:
        for engine in given.engines:
            lost = []
            progress = Progress(given.robots, 0)
            for robot in range(given.first_robot, given.first_robot + given.robots):
                upright = policy.stays_upright(kind, runs.config_path(kind), robot, engine, given.fidelity)
                lost += [] if upright else [robot]
                progress.add([{"fell": not upright}])
            kept = given.robots - len(lost)
            low, high = (100 * limit for limit in wilson(kept, given.robots))
            print(
                f"policy, {kind}, {engine}, {given.fidelity}, {policy.TICKS} ticks: {kept} of {given.robots} "
                f"upright ({100 * kept / given.robots:.1f} %, 95 %: {low:.1f} to {high:.1f}), "
                f"lost: {lost or 'none'}",
                flush=True,
            )


def arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/benchmark", description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=200, help="of each type")
    parser.add_argument("--first-robot", type=int, default=901)
    for name, all_of in (
        ("kinds", runs.CONFIGS),
        ("peers", PEERS),
        ("points", runs.POINTS),
        ("engines", runs.ENGINES),
    ):
        parser.add_argument(
            f"--{name}", nargs="+", choices=list(all_of), default=list(filter(available, all_of))
        )
    parser.add_argument("--fidelity", default="built2025", choices=("built2025", "full", "nominal"))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=repository_root() / "build" / "benchmark")
    parser.add_argument("--write", action="store_true", help="docs/reports/benchmark.md and .json")
    parser.add_argument("--tune", action="store_true", help="search each peer's numbers; robots from 851")
    parser.add_argument("--budget", type=int, default=24, help="choices that each search may try")
    parser.add_argument("--training", type=int, default=6, help="robots that each choice is tried on")
    parser.add_argument("--train", action="store_true", help="the policy anew, by PPO")
    parser.add_argument(
        "--steps", type=int, default=3_000_000, help="ticks of all robots that it is trained for"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--held-out", action="store_true", help="the policy on robots that it was not trained on"
    )
    given = parser.parse_args(words)
    if min(given.robots, given.workers, given.budget, given.training, given.steps) < 1:
        parser.error("numbers must be 1 or more")
    last = tuning.FIRST_ROBOT + 50
    if given.training > 50 or not (given.tune or given.first_robot >= last):
        parser.error(f"robots {tuning.FIRST_ROBOT} to {last - 1} are for the search, those after it score")
    return given


def main(words: list[str] | None = None) -> int:
    given = arguments(words)
    try:
        if given.tune:
            tune(given)
            print(tuning.FOUND)
            return 0
        if given.train:
            train(given)
            print(policy.FILE)
            return 0
        if given.held_out:
            held_out(given)
            return 0
        rows = benchmark(given)
        about = {**about_of(given, tuning.found()), "robots": given.robots}
        about["commit"], about["date"] = commit_and_date()
        exact = json.dumps(score.scores(rows))
        told = json.loads(exact, parse_float=lambda number: round(float(number), 4))
        path = given.out / "scores.json"
        lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in told)
        kept = f'{{"about": {json.dumps(about)}, "scores": [\n{lines}\n]}}\n'
        page = score.page(told, about)
        path.write_text(kept)
        path.with_name(PAGE.name).write_text(page)
        picture.draw(told, path.with_name(PAGE.name))
        if given.write:
            KEPT.write_text(kept)
            PAGE.write_text(page)
            picture.draw(told, PAGE)
        print(path)
    except (UserError, OSError, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        kept = "what was finished is kept" if given.train else "the same command goes on from here"
        print(f"\ninterrupted; {kept}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    leave(main)
