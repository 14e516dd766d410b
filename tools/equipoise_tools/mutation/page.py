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

KILLED = ("killed", "timeout")
HEAD = """# Mutation testing
Written by `tools/mutation`. A mutant is the firmware with one token changed: a relation (`<` → `<=`), an
operator (`+` → `-`, `&&` → `||`), a number (n → n + 1, x → 2 x), a condition negated, a statement
removed. It is killed when a test of its room fails or exceeds ten times its usual time. Changes that do not
compile, or to the same object code, are not counted.

{what} Seed {seed}; intervals are Wilson's, 95 %.

| room | mutants in all | drawn | killed | survived | kill rate | wanted | holds |
|---|---|---|---|---|---|---|---|
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


def write_page(
    measured: dict[str, list[tuple[Path, str, Mutant, Outcome]]],
    why: dict[tuple[str, str, str], str],
    sample: int | None,
    seed: int,
    root: Path,
) -> tuple[str, list[str]]:
    """The page, and survivors without a reason. `sample`: None of kept outcomes, 0 of all mutants."""
    what = f"At most {sample} mutants per room, drawn at random." if sample else "All mutants."
    if sample is None:
        what = (
            "Drawn at random; of what was measured before (`--kept`), each room as far as it got.\n"
            "Survivors of older tests have not been tried on today's: kill rates are lower bounds."
        )
    page = HEAD.format(what=what, seed=seed)
    survivors, unexplained = "", []
    for name, outcomes in measured.items():
        counts = Counter(outcome.status for *_, outcome in outcomes)
        killed = sum(counts[status] for status in KILLED)
        tried = killed + counts["survived"]
        target = ROOMS[name].target
        whole = sum(len(mutants(path.read_text())) for path in ROOMS[name].paths(root))
        if not tried:
            page += f"| {name} | {whole} | 0 | | | not measured | {100 * target:.0f} % | not measured |\n"
            continue
        share = killed / tried
        low, high = wilson(killed, tried)
        rate = f"{100 * share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
        holds = "yes" if share >= target else "**no**"
        row = (name, whole, tried, killed, counts["survived"], rate, f"{100 * target:.0f} %", holds)
        page += f"| {' | '.join(map(str, row))} |\n"
        for file, text, mutant, outcome in outcomes:
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
