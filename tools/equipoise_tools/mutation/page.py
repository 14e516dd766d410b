"""docs/mutation.md: how many mutants each room's tests noticed, and why the others live."""

from __future__ import annotations

import tomllib
from collections import Counter
from pathlib import Path

from ..campaign_statistics import wilson
from .bench import Outcome
from .generate import Mutant, mutants
from .rooms import ROOMS
from .store import OLDER_TESTS

Outcomes = list[tuple[Path, str, Mutant, Outcome]]
Measured = dict[str, Outcomes]
KILLED = ("killed", "timeout")
FEWEST = 20  # mutants that say something about a room
HEAD = """# Mutation testing
Written by `tools/mutation`. A mutant is the firmware with one token changed: a relation (`<` → `<=`), an
operator (`+` → `-`, `&&` → `||`), a number (n → n + 1, x → 2 x), a condition negated, a statement
removed. It is killed when a test of its room fails or exceeds ten times its usual time. Changes that do not
compile, or to the same object code, are not counted.

{what} Seed {seed}; intervals are Wilson's, 95 %.
"""
TABLE = """
| room | mutants in all | drawn | killed | survived | explained | kill rate | wanted | holds |{more}
|---|---|---|---|---|---|---|---|---|{rule}
"""


def line_of(text: str, mutant: Mutant) -> str:
    return " ".join(text.splitlines()[mutant.line - 1].split())


def reasons(root: Path) -> dict[tuple[str, str, str], str]:
    """Of (file, its line, change): why no test notices."""
    path = root / "tests" / "mutation" / "reasons.toml"
    if not path.is_file():
        return {}
    told = tomllib.loads(path.read_text())["survivor"]
    return {(each["file"], each["code"], each["change"]): each["reason"] for each in told}


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def counted(outcomes: Outcomes) -> tuple[int, int]:
    """Tried, killed."""
    counts = Counter(outcome.status for *_, outcome in outcomes)
    killed = sum(counts[status] for status in KILLED)
    return killed + counts["survived"], killed


def write_page(
    measured: Measured,
    why: dict[tuple[str, str, str], str],
    sample: int | None,
    seed: int,
    root: Path,
    learnt: dict[tuple[str, int], Outcomes] | None = None,
) -> tuple[str, list[str]]:
    """The page, and survivors without a reason. `sample`: None of kept outcomes, 0 of all mutants. `learnt`:
    outcomes of other samples by room and seed, for which tests were written."""
    learnt = learnt or {}
    what = f"At most {sample} mutants per room, drawn at random." if sample else "All mutants."
    if sample is None:
        what = (
            "Drawn at random; of what was measured before (`--kept`), each room as far as it got.\n"
            "Survivors of older tests have not been tried on today's: kill rates are lower bounds."
        )
    page = HEAD.format(what=what, seed=seed)
    *others, last = sorted({seed for _, seed in learnt}) or [0]
    seeds = f"{', '.join(map(str, others))} and {last}" if others else str(last)
    if learnt:
        page += (
            f"The samples of seed {seeds} showed what the tests lacked, and tests were written for them; "
            "none of their\nmutants is in this one, whose rate is the one that holds or not.\n"
        )
    beside = any(learnt.values())
    if learnt and not beside:
        page += "What became of theirs has not been measured again on today's tests.\n"
    page += TABLE.format(more=f" seed {seeds} |" if beside else "", rule="---|" if beside else "")
    survivors, unexplained = "", []
    for name, outcomes in measured.items():
        tried, killed = counted(outcomes)
        seen = {
            (file, mutant): (file, text, mutant, outcome)
            for (room, _), some in learnt.items()
            if room == name
            for file, text, mutant, outcome in some
        }
        more = ""
        if beside:
            before, noticed = counted(list(seen.values()))
            more = f" {noticed} of {before} |" if before else " not measured |"
        explained = sum(
            outcome.status == "survived" and (str(file), line_of(text, mutant), mutant.change) in why
            for file, text, mutant, outcome in outcomes
        )
        target = ROOMS[name].target
        whole = sum(len(mutants(path.read_text())) for path in ROOMS[name].paths(root))
        if tried:
            share = killed / tried
            low, high = wilson(killed, tried)
            rate = f"{100 * share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
            holds = "yes" if share >= target else "**no**"
            holds = holds if tried >= FEWEST else "too few"
            lived = (tried - killed, explained)
            row = (name, whole, tried, killed, *lived, rate, f"{100 * target:.0f} %", holds)
        else:
            row = (name, whole, 0, "", "", "", "not measured", f"{100 * target:.0f} %", "not measured")
        page += f"| {' | '.join(map(str, row))} |{more}\n"
        for file, text, mutant, outcome in [*seen.values(), *outcomes]:
            if outcome.status != "survived":
                continue
            code = line_of(text, mutant)
            reason = why.get((str(file), code, mutant.change), "")
            if not reason and outcome.by == OLDER_TESTS:
                reason = "not tried since the tests changed"
            if not reason:
                unexplained.append(f"{file}:{mutant.line} {mutant.change}   [{code}]")
            cells = (f"{file}:{mutant.line}", f"`{mutant.change}`", reason or "**none yet**")
            survivors += f"| {' | '.join(map(cell, cells))} |\n"
    if survivors:
        page += f"\n## Survivors\n| where | change | why no test notices |\n|---|---|---|\n{survivors}"
    return page, unexplained
