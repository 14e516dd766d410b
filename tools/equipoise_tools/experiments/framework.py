"""Findings, their status, and how an experiment becomes a page and a line of the summary."""

from __future__ import annotations

import importlib
import json
import math
import pkgutil
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from . import coverage
from .data import Data, Ran

_NOT_EXPERIMENTS = {"__main__", "framework", "coverage", "runs", "data", "timeplot", "published_kf"}

PUBLISHED, CORRECTED, FITTED = "as published", "with our correction", "input or fitted"
REFUTED, NOT_SHOWN = "refuted", "not shown"
STATUSES = {
    PUBLISHED: "the statement holds with the filter, controller and gains that [T] publishes",
    CORRECTED: "it holds once something of ours replaces what is published; the page says what",
    FITTED: "it holds because a number was put in or fitted; no evidence for the statement",
    REFUTED: "it follows from what [T] publishes, and does not hold with it",
    NOT_SHOWN: "it does not hold here, or cannot be tested here; not shown to be false",
}
# What [T] publishes. Everything else in a run is ours.
PUBLISHED_FILTERS = {
    "-",
    "ekf13_published",
    "ekf_published",
    "planar_kf",
    "complementary",
    "complementary_kf",
    "kf_attitude as published",
    "kf as published",
}
PUBLISHED_CONTROL = {"-", "thesis as published", "slc as published"}
RELATIONS = {
    "at least": lambda measured, limit: measured >= limit[0],
    "at most": lambda measured, limit: measured <= limit[0],
    "between": lambda measured, limit: limit[0] <= measured <= limit[1],
}


def standing(ran: Ran) -> str:
    if ran.fitted:
        return FITTED
    of_t = (
        ran.filter in PUBLISHED_FILTERS
        and ran.control in PUBLISHED_CONTROL
        and ran.gains.startswith(("-", "[T]"))
    )
    return PUBLISHED if of_t else CORRECTED


@dataclass
class Value:
    """One quantity over the seeds beside [T]'s; `published` is None where [T] has no number."""

    target: str
    what: str
    ran: Ran
    median: float | None
    low: float | None  # 5 and 95 % over the seeds; None: one evaluation
    high: float | None
    runs: int
    published: float | None = None
    unit: str = ""

    @property
    def ratio(self) -> float | None:
        return self.median / self.published if self.median is not None and self.published else None


@dataclass
class Finding:
    """`statistic` of `quantity` in `case`, as a ratio to that of `over` if given, against a limit."""

    target: str
    text: str
    claim: str  # "[T]": its statement; "ours": beside it, gives no status
    derived: bool  # follows from what [T] publishes, so that it can be refuted here
    ran: Ran
    case: str
    quantity: str
    statistic: str
    over: list[str] | None  # [case, quantity, filter]
    measured: float
    relation: str
    limit: list[float]
    holds: bool


def measure(finding: Finding, data: Data) -> float:
    """NaN, of which no relation holds, when no run has the number."""
    measured = data.statistic(finding.case, finding.quantity, finding.ran.filter, finding.statistic)
    if finding.over is not None:
        measured /= data.statistic(*finding.over, statistic=finding.statistic)
    return measured


def holds(finding: Finding) -> bool:
    return bool(RELATIONS[finding.relation](finding.measured, finding.limit))


@dataclass
class Result:
    title: str
    command: str  # how to do it by hand
    method: str
    differs: str  # why our numbers are not [T]'s
    data: Data
    values: list[Value] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)  # names, without .png

    def check(
        self,
        target: str,
        text: str,
        case: str,
        quantity: str,
        filter_name: str | None = None,
        *,
        at_least: float | None = None,
        at_most: float | None = None,
        between: tuple[float, float] | None = None,
        statistic: str = "median",
        over: tuple[str, str, str] | None = None,
        claim: str = "[T]",
        derived: bool = False,
    ) -> None:
        relation, limit = next(
            (name, list(limits))
            for name, limits in (
                ("at least", (at_least,)),
                ("at most", (at_most,)),
                ("between", between or (None,)),
            )
            if limits[0] is not None
        )
        ran = self.data.ran(case, quantity, filter_name)
        finding = Finding(
            target, text, claim, derived, ran, case, quantity, statistic, list(over) if over else None,
            math.nan, relation, limit, False,
        )  # fmt: skip
        finding.measured = measure(finding, self.data)
        finding.holds = holds(finding)
        self.findings.append(finding)

    def add(
        self,
        target: str,
        what: str,
        case: str,
        quantity: str,
        filter_name: str | None = None,
        published: float | None = None,
        unit: str = "",
        scale: float = 1.0,
    ) -> None:
        values = scale * self.data.values(case, quantity, filter_name)
        ran = self.data.ran(case, quantity, filter_name)
        median, low, high = (None, None, None)
        if values.size:
            median = float(np.median(values))
        if values.size > 1:
            low, high = (float(x) for x in np.percentile(values, (5, 95)))
        self.values.append(Value(target, what, ran, median, low, high, int(values.size), published, unit))


def names() -> list[str]:
    package = importlib.import_module(__package__)
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if m.name not in _NOT_EXPERIMENTS)


def load(name: str):
    return importlib.import_module(f"{__package__}.{name}")


def measured(module, lab) -> Data:
    """The module's own measurement, or runs of its cases."""
    return module.measure(lab) if hasattr(module, "measure") else lab.run(module.cases())


def number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def limits(finding: Finding) -> str:
    return f"{finding.relation} {' and '.join(number(x) for x in finding.limit)}"


def status(findings: list[Finding]) -> str:
    """The most that the findings about [T]'s statements support."""
    claims = [f for f in findings if f.claim == "[T]"]
    if not claims:
        return NOT_SHOWN
    if any(f.derived and not f.holds and standing(f.ran) == PUBLISHED for f in claims):
        return REFUTED
    failed = {(f.text, str(f.ran)) for f in claims if not f.holds}  # in one world, say, of two that it names
    borne_out = {f.text for f in claims if (f.text, str(f.ran)) not in failed}
    if any(f.text not in borne_out for f in claims):
        return NOT_SHOWN
    first_failed = any(not f.holds for f in claims)
    used = {standing(f.ran) for f in claims if f.holds}
    if FITTED in used:
        return FITTED
    return CORRECTED if CORRECTED in used or first_failed else PUBLISHED


def reason(findings: list[Finding]) -> str:
    """Counts, and what does not hold."""
    claims = [f for f in findings if f.claim == "[T]"]
    if not claims:
        return "nothing of [T]'s is tested"
    failed = [f for f in claims if not f.holds]
    words = f"{len(claims) - len(failed)} of {len(claims)} findings hold"
    texts = dict.fromkeys(f"{f.text} ({f.ran.filter})" if f.ran.filter != "-" else f.text for f in failed)
    shown = list(texts)[:3]
    more = f" and {len(texts) - 3} more" if len(texts) > 3 else ""
    return words + (f"; not: {'; '.join(shown)}{more}" if shown else "")


def complaints(record: dict, data: Data) -> list[str]:
    """What a record claims beyond its data: wrong sign, limit, number, subject or status."""
    wrong = []
    findings = [Finding(**{**f, "ran": Ran(**f["ran"])}) for f in record["findings"]]
    for f in findings:
        try:
            ran = data.ran(f.case, f.quantity, f.ran.filter)
        except KeyError as missing:
            wrong.append(f"{f.target}: {f.text}: {missing}")
            continue
        if ran != f.ran:
            wrong.append(f"{f.target}: {f.text}: ran {ran}, not {f.ran}")
        measured = measure(f, data)
        if not (measured == f.measured or (math.isnan(measured) and math.isnan(f.measured))):
            wrong.append(f"{f.target}: {f.text}: {number(measured)} in the data, not {number(f.measured)}")
        if holds(f) != f.holds:
            wrong.append(f"{f.target}: {f.text}: {number(f.measured)} {limits(f)} is {holds(f)}")
    for target, claimed in record["statuses"].items():
        supported = status([f for f in findings if f.target == target])
        if claimed != supported:
            wrong.append(f"{target}: the findings support '{supported}', not '{claimed}'")
    return wrong


def page(name: str, result: Result, at: str = "") -> str:
    """`at`: commit and date of the data."""
    lines = [f"# {result.title}", "", result.method, "", "```", result.command, "```", ""]
    lines += [f"Data of {at}.", ""] if at else []
    lines += [f"![{picture}]({picture}.png)\n" for picture in result.pictures]
    values = [v for v in result.values if v.runs]
    setups = dict.fromkeys(str(row.ran) for row in [*result.findings, *values])
    number_of = {setup: i for i, setup in enumerate(setups, 1)}
    lines += ["What ran:", "", *(f"{i}. {setup}" for setup, i in number_of.items()), ""] if setups else []
    if result.findings:
        lines += ["## Findings", ""]
        lines += ["`whose`: [T]'s statement, or ours beside it. Only [T]'s count for the status.", ""]
        lines += [
            "| of | statement | whose | ran | measured | needs | holds |",
            "|---|---|---|--:|--:|---|---|",
        ]
        lines += [
            f"| {f.target} | {f.text} | {f.claim} | {number_of[str(f.ran)]} | {number(f.measured)} | "
            f"{limits(f)} | {'yes' if f.holds else '**no**'} |"
            for f in result.findings
        ]
    if values:
        lines += ["", "## Values", ""]
        lines += ["Median and 5 to 95 % over the runs; ratio: median over [T]'s.", ""]
        head = "| of | quantity | ran | median | 5 to 95 % | runs | [T] | ratio | unit |"
        lines += [head, "|---|---|--:|--:|--:|--:|--:|--:|---|"]
        lines += [
            f"| {v.target} | {v.what} | {number_of[str(v.ran)]} | {number(v.median)} | "
            f"{'–' if v.low is None else f'{number(v.low)} to {number(v.high)}'} | {v.runs} | "
            f"{number(v.published)} | {number(v.ratio)} | {v.unit} |"
            for v in values
        ]
    lines += ["", f"Why they differ: {result.differs}", "", f"Every run: [Parquet](data/{name}.parquet)", ""]
    return "\n".join(lines)


def record_of(result: Result) -> dict:
    targets = sorted({v.target for v in result.values} | {f.target for f in result.findings})
    return {
        "title": result.title,
        "covers": targets,
        "statuses": {t: status([f for f in result.findings if f.target == t]) for t in targets},
        "findings": [asdict(f) for f in result.findings],
    }


def write(name: str, result: Result, out_dir: Path, at: str = "") -> None:
    """NAME.md, and NAME.json for the summary."""
    out_dir.mkdir(parents=True, exist_ok=True)
    (out_dir / f"{name}.md").write_text(page(name, result, at))
    record = record_of(result)
    findings = ",\n".join(
        json.dumps(f, ensure_ascii=False, separators=(",", ":")) for f in record.pop("findings")
    )
    head = json.dumps(record, indent=1, ensure_ascii=False).removesuffix("\n}")
    (out_dir / f"{name}.json").write_text(f'{head},\n "findings": [\n{findings}\n]}}\n')


def summary(out_dir: Path) -> str:
    """README.md of the folder, from the experiments that have been run into it."""
    records = {file.stem: json.loads(file.read_text()) for file in sorted(out_dir.glob("*.json"))}
    lines = [*coverage.INTRODUCTION, "", "| status | means |", "|---|---|"]
    lines += [f"| {word} | {meaning} |" for word, meaning in STATUSES.items()]
    lines += ["", "| of [T] | what | status | why | experiment |", "|---|---|---|---|---|"]
    targets = dict(coverage.TARGETS)
    for record in records.values():
        for target in record["covers"]:
            targets.setdefault(target, (record["title"], ""))
    for target, (what, why) in targets.items():
        covering = [name for name, record in records.items() if target in record["covers"]]
        findings = [
            Finding(**{**f, "ran": Ran(**f["ran"])})
            for name in covering
            for f in records[name]["findings"]
            if f["target"] == target
        ]
        links = ", ".join(f"[{name}]({name}.md)" for name in covering) or "none"
        because = "; ".join(text for text in (why, reason(findings)) if text)
        lines.append(f"| {target} | {what} | {status(findings)} | {because} | {links} |")
    return "\n".join(lines) + "\n"
