"""`tools/mutation`: draws mutants, judges them, keeps the outcomes, writes docs/reports/mutation.md."""

from __future__ import annotations

import argparse
import os
import queue
import random
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..entry import leave
from ..paths import UserError, repository_root
from .bench import Build, Outcome, Worker
from .generate import Mutant, mutants
from .page import reasons, write_page
from .parts import PARTS, Part, Stage
from .store import Store, key_of, tests_of

SAMPLE = 40  # mutants per part


def drawn(part: Part, name: str, root: Path, sample: int, seed: int) -> list[tuple[Path, str, Mutant]]:
    """A random sample of a part's mutants; a larger one contains a smaller one."""
    every = []
    for path in part.paths(root):
        text = path.read_text()
        file = path.relative_to(root)
        every += [(file, text, mutant) for mutant in mutants(text)]
    random.Random(f"{seed} {name}").shuffle(every)
    return every[:sample] if sample else every


def unseen(
    part: Part,
    name: str,
    root: Path,
    sample: int,
    seed: int,
    learnt: list[int],
    learnt_sample: int = SAMPLE,
) -> list[tuple[Path, str, Mutant]]:
    """A sample of another seed without the mutants of the samples for which tests were written, whether these
    were drawn of all mutants or without the samples before them."""
    every = drawn(part, name, root, 0, seed)
    known = {each for one in learnt for each in drawn(part, name, root, learnt_sample, one)}
    if learnt:
        last, before = learnt[-1], learnt[:-1]
        known |= set(unseen(part, name, root, learnt_sample, last, before, learnt_sample))
    return [each for each in every if each not in known][:sample]


def kept(
    store: Store, chosen: list[tuple[Path, str, Mutant]], tests: str
) -> list[tuple[Path, str, Mutant, Outcome]]:
    """Those of a sample that are known, up to the first that is not: a smaller sample."""
    outcomes = []
    for file, text, mutant in chosen:
        outcome = store.kept(key_of(file, mutant.of(text)), tests)
        if outcome is None:
            break
        outcomes.append((file, text, mutant, outcome))
    return outcomes


class Campaign:
    def __init__(self, root: Path, store: Store, jobs: int, work: Path):
        self.root, self.store = root, store
        build = Build(root, root / "build" / "host")
        self.workers: queue.SimpleQueue[Worker] = queue.SimpleQueue()
        for i in range(jobs):
            self.workers.put(Worker(build, work / f"worker-{i}"))
        self.jobs = jobs
        self.lock = threading.Lock()
        self.limits: dict[Stage, float] = {}
        self.codes: dict[Path, str] = {}

    def limit(self, worker: Worker, stage: Stage) -> float:
        """Asked for when a mutant gets as far as that stage, which few do."""
        with self.lock:
            if stage not in self.limits:
                self.limits[stage] = worker.limit(stage)
        return self.limits[stage]

    def unchanged_code(self, worker: Worker, file: Path, text: str) -> str:
        with self.lock:
            if file not in self.codes:
                self.codes[file] = worker.unchanged_code(file, text)
        return self.codes[file]

    def judge(self, part: Part, tests: str, file: Path, text: str, mutant: Mutant) -> Outcome:
        worker = self.workers.get()
        try:
            stages = [stage for stage in part.stages if stage.is_for(str(file))]
            same = self.unchanged_code(worker, file, text)
            outcome = worker.judge(stages, file, text, mutant, self.limit, same)
        finally:
            self.workers.put(worker)
        self.store.add(key_of(file, mutant.of(text)), tests, file, mutant, outcome)
        print(f"{outcome.status:12} {file}:{mutant.line} {mutant.change[:90]}", file=sys.stderr, flush=True)
        return outcome

    def go(
        self, name: str, part: Part, chosen: list[tuple[Path, str, Mutant]]
    ) -> list[tuple[Path, str, Mutant, Outcome]]:
        tests = tests_of(part, self.root)
        known = [self.store.known(key_of(file, mutant.of(text)), tests) for file, text, mutant in chosen]
        print(f"{name}: {len(chosen)} mutants, {sum(map(bool, known))} known", file=sys.stderr, flush=True)
        with ThreadPoolExecutor(self.jobs) as pool:
            waiting = [
                None if was else pool.submit(self.judge, part, tests, *each)
                for each, was in zip(chosen, known, strict=True)
            ]
            try:
                outcomes = [was or future.result() for was, future in zip(known, waiting, strict=True)]
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        return [(*each, outcome) for each, outcome in zip(chosen, outcomes, strict=True)]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="tools/mutation",
        description="Changes the firmware by one token at a time and looks which changes its tests notice. "
        "Outcomes are kept in build/mutation: started again it goes on where it was interrupted. Writes "
        "docs/reports/mutation.md when no part is named. Exit status: 1 when a survivor has no reason in "
        "tests/mutation/reasons.toml.",
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants per part (default 40; 0: all)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default 1)")
    parser.add_argument(
        "--learnt",
        type=int,
        nargs="+",
        default=[],
        metavar="SEED",
        help="samples for which tests were written: that of --seed has none of their mutants. They are "
        "judged, too, and counted apart",
    )
    parser.add_argument(
        "--learnt-sample", type=int, default=SAMPLE, help="mutants per part of each of them (default 40)"
    )
    parser.add_argument(
        "--fresh-only", action="store_true", help="exclude the samples of --learnt without judging them"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time (default: the cores)")
    parser.add_argument("--list", action="store_true", help="print the sample and change nothing")
    parser.add_argument(
        "--kept", action="store_true", help="judge nothing: a page of what was measured before of this code"
    )
    parser.add_argument(
        "--page",
        action="store_true",
        help="write the page also when parts are named; the others keep their rows",
    )
    options = parser.parse_args()
    unknown = [name for name in options.parts if name not in PARTS]
    if unknown:
        parser.error(f"no part {', '.join(unknown)}; there are: {', '.join(PARTS)}")
    root = repository_root()
    chosen = {name: PARTS[name] for name in options.parts or PARTS}
    if options.learnt and not options.sample:
        parser.error("--learnt needs a --sample: of all mutants none is left unseen")
    if options.list:
        for name, part in chosen.items():
            for file, _, mutant in drawn(part, name, root, options.sample, options.seed):
                print(f"{name} {file}:{mutant.line} {mutant.kind}: {mutant.change}")
        return 0
    if not (root / "build" / "host" / "build.ninja").is_file():
        raise UserError("there is no build to start from; tools/mutation makes one")
    place = root / "build" / "mutation"
    place.mkdir(parents=True, exist_ok=True)
    store = Store(place / "results.jsonl")
    samples = {
        name: (
            unseen(part, name, root, options.sample, options.seed, options.learnt, options.learnt_sample)
            if options.learnt
            else drawn(part, name, root, options.sample, options.seed)
        )
        for name, part in chosen.items()
    }
    learnt = {
        (name, seed): drawn(part, name, root, options.learnt_sample, seed)
        for name, part in chosen.items()
        for seed in options.learnt
    }
    if options.kept:

        def outcomes(name: str, sample: list[tuple[Path, str, Mutant]]):
            return kept(store, sample, tests_of(PARTS[name], root))

        measured = {name: outcomes(name, sample) for name, sample in samples.items()}
        before = {key: [] if options.fresh_only else outcomes(key[0], each) for key, each in learnt.items()}
    else:
        with tempfile.TemporaryDirectory(dir=place, prefix="work-") as work:
            campaign = Campaign(root, store, options.jobs, Path(work))
            measured = {name: campaign.go(name, PARTS[name], sample) for name, sample in samples.items()}
            before = {
                key: [] if options.fresh_only else campaign.go(key[0], PARTS[key[0]], each)
                for key, each in learnt.items()
            }
    why = reasons(root)
    page = root / "docs" / "reports" / "mutation.md"
    to_page = options.page or not options.parts
    earlier = page.read_text() if to_page and options.parts else ""
    text, unexplained = write_page(measured, why, options.seed, root, before, earlier)
    if to_page:
        page.write_text(text)
    else:
        print(text)
    for line in unexplained:
        print(f"no reason for: {line}", file=sys.stderr)
    return 1 if unexplained else 0


if __name__ == "__main__":
    leave(main)
