"""docs/reports/mutation.md: how many mutants each part's tests noticed, and why the others live."""

from __future__ import annotations

import tomllib
from collections import Counter
from pathlib import Path

from ..campaign_statistics import wilson
from ..paths import commit_and_date
from .bench import Outcome
from .generate import Mutant, mutants
from .parts import PARTS
from .store import OLDER_TESTS

Outcomes = list[tuple[Path, str, Mutant, Outcome]]
Measured = dict[str, Outcomes]
KILLED = ("killed", "timeout")
FEWEST = 20  # mutants that say something about a part
OLDER = "not tried since the tests changed"
HEAD = """# Mutation testing
Written by `tools/mutation`, last at {commit}, {date}. A mutant is the firmware with one token changed: a
relation (`<` → `<=`), an operator (`+` → `-`, `&&` → `||`), a number (n → n + 1, x → 2 x), a negated
condition, a removed statement. It is killed when a test of its part fails or exceeds ten times its usual
time. Changes that do not compile, or give the same object code, are not counted; the rate excludes those
whose reason says that they are equivalent ("equivalent").

Mutants are drawn at random; intervals are Wilson's, 95 %. Sample "5 without 1, 2" is that of seed 5 without
the mutants of the samples of seeds 1 and 2, which showed what the tests lacked and for which tests were
written; "before" says how many of those are killed now. A part keeps its rows until it is measured again;
survivors that have not been tried since the tests changed may be killed by now.

| part | mutants in all | sample | drawn | killed | survived | equivalent | rate | required | holds | before |
|---|---|---|---|---|---|---|---|---|---|---|
"""
SURVIVORS = """
## Survivors
| where | change | why no test notices |
|---|---|---|
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


def rows_of(page: str, name: str, root: Path) -> tuple[str, str]:
    """A part's row of an earlier page, and those of its survivors."""
    files = {str(path.relative_to(root)) for path in PARTS[name].paths(root)}
    table, _, survivors = page.partition(SURVIVORS)
    row = [line for line in table.splitlines(True) if line.startswith(f"| {name} |")]
    theirs = [line for line in survivors.splitlines(True) if line[2:].partition(":")[0] in files]
    return "".join(row), "".join(theirs)


def part_row(name: str, root: Path, sample: str, outcomes: Outcomes, explained: int, before: Outcomes) -> str:
    tried, killed = counted(outcomes)
    target = f"{100 * PARTS[name].target:.0f} %"
    whole = sum(len(mutants(path.read_text())) for path in PARTS[name].paths(root))
    cells: tuple[object, ...] = (name, whole, "", 0, "", "", "", "not measured", target, "not measured")
    telling = tried - explained
    if telling:
        low, high = wilson(killed, telling)
        rate = f"{100 * killed / telling:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
        holds = "yes" if killed / telling >= PARTS[name].target else "**no**"
        holds = holds if telling >= FEWEST else "too few"
        cells = (name, whole, sample, tried, killed, tried - killed, explained, rate, target, holds)
    known, noticed = counted(before)
    return f"| {' | '.join(map(str, cells))} | {f'{noticed} of {known}' if known else ''} |\n"


def write_page(
    measured: Measured,
    why: dict[tuple[str, str, str], str],
    seed: int,
    root: Path,
    learnt: dict[tuple[str, int], Outcomes] | None = None,
    earlier: str = "",
) -> tuple[str, list[str]]:
    """The page, and survivors without a reason. `learnt`: outcomes of other samples by part and seed, for
    which tests were written. `earlier`: the page whose rows the parts keep that were not measured."""
    learnt = learnt or {}
    commit, today = commit_and_date()
    page, survivors, unexplained = HEAD.format(commit=commit, date=today), "", []
    seeds = sorted({one for _, one in learnt})
    sample = f"{seed} without {', '.join(map(str, seeds))}" if seeds else str(seed)
    for name in [*PARTS] if earlier else measured:
        if name not in measured:
            row, theirs = rows_of(earlier, name, root)
            page += row
            survivors += theirs
            continue
        outcomes = measured[name]
        seen = {
            (file, mutant): (file, text, mutant, outcome)
            for (part, _), some in learnt.items()
            if part == name
            for file, text, mutant, outcome in some
        }
        explained = sum(
            outcome.status == "survived" and (str(file), line_of(text, mutant), mutant.change) in why
            for file, text, mutant, outcome in outcomes
        )
        page += part_row(name, root, sample, outcomes, explained, list(seen.values()))
        for file, text, mutant, outcome in [*seen.values(), *outcomes]:
            if outcome.status != "survived":
                continue
            code = line_of(text, mutant)
            reason = why.get((str(file), code, mutant.change), "")
            if not reason and outcome.by == OLDER_TESTS:
                reason = OLDER
            if not reason:
                unexplained.append(f"{file}:{mutant.line} {mutant.change}   [{code}]")
            cells = (f"{file}:{mutant.line}", f"`{mutant.change}`", reason or "**none yet**")
            survivors += f"| {' | '.join(map(cell, cells))} |\n"
    return page + (SURVIVORS + survivors if survivors else ""), unexplained
