"""What an experiment returns, and how it becomes a page, a CSV, a PNG and a line of the summary."""

from __future__ import annotations

import csv
import importlib
import json
import pkgutil
from dataclasses import asdict, dataclass, field
from pathlib import Path

from . import coverage

_NOT_EXPERIMENTS = {"__main__", "framework", "coverage", "runs"}


@dataclass
class Value:
    """One number of ours beside [T]'s; `printed` is None where [T] has none (a figure, or not in the "
    "text)."""

    target: str
    what: str
    ours: float | None
    printed: float | None = None
    unit: str = ""

    @property
    def ratio(self) -> float | None:
        return self.ours / self.printed if self.ours is not None and self.printed else None


@dataclass
class Finding:
    """A statement of [T] or of ours, and whether this run bears it out."""

    target: str
    text: str
    holds: bool


@dataclass
class Result:
    title: str
    command: str  # how to do it by hand
    method: str
    differs: str  # one sentence: why our numbers are not [T]'s
    values: list[Value] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)  # names of PNGs that run() wrote into out_dir

    def check(self, target: str, text: str, holds: bool) -> None:
        self.findings.append(Finding(target, text, bool(holds)))

    def add(self, target: str, what: str, ours, printed: float | None = None, unit: str = "") -> None:
        self.values.append(Value(target, what, None if ours is None else float(ours), printed, unit))


def names() -> list[str]:
    package = importlib.import_module(__package__)
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if m.name not in _NOT_EXPERIMENTS)


def load(name: str):
    return importlib.import_module(f"{__package__}.{name}")


def number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def page(name: str, result: Result) -> str:
    lines = [f"# {result.title}", "", result.method, "", "```", result.command, "```", ""]
    lines += [f"![{result.title}]({picture})" for picture in result.pictures]
    if result.findings:
        lines += ["", "## Findings", "", "| of | statement | holds |", "|---|---|---|"]
        lines += [f"| {f.target} | {f.text} | {'yes' if f.holds else '**no**'} |" for f in result.findings]
    if result.values:
        lines += [
            "",
            "## Values",
            "",
            "| of | quantity | ours | [T] | ratio | unit |",
            "|---|---|--:|--:|--:|---|",
        ]
        lines += [
            f"| {v.target} | {v.what} | {number(v.ours)} | {number(v.printed)} | {number(v.ratio)} | "
            f"{v.unit} |"
            for v in result.values
        ]
    lines += ["", f"Why they differ: {result.differs}", "", f"All values: [{name}.csv]({name}.csv)", ""]
    return "\n".join(lines)


def write(name: str, result: Result, out_dir: Path) -> None:
    """NAME.md, NAME.csv, and NAME.json for the summary."""
    out_dir.mkdir(parents=True, exist_ok=True)
    (out_dir / f"{name}.md").write_text(page(name, result))
    with (out_dir / f"{name}.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["target", "quantity", "ours", "printed", "ratio", "unit"])
        for v in result.values:
            cells = ["" if x is None else f"{x:.6g}" for x in (v.ours, v.printed, v.ratio)]
            rows.writerow([v.target, v.what, *cells, v.unit])
    record = {
        "title": result.title,
        "covers": sorted({v.target for v in result.values} | {f.target for f in result.findings}),
        "findings": [asdict(f) for f in result.findings],
    }
    (out_dir / f"{name}.json").write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")


def status(target: str, records: dict[str, dict]) -> tuple[str, str]:
    """(status, links) of a table or figure, over all experiments that answer for it."""
    covering = [name for name, record in records.items() if target in record["covers"]]
    if not covering:
        return "not done", ""
    links = ", ".join(f"[{name}]({name}.md)" for name in covering)
    findings = [f for name in covering for f in records[name]["findings"] if f["target"] == target]
    if not findings:
        return "shown", links
    failed = [f["text"] for f in findings if not f["holds"]]
    if not failed:
        return "reproduced", links
    word = "in part" if len(failed) < len(findings) else "not reproduced"
    return f"{word}; not so: {'; '.join(failed)}", links


def summary(out_dir: Path) -> str:
    """README.md of the folder, from the experiments that have been run into it."""
    records = {file.stem: json.loads(file.read_text()) for file in sorted(out_dir.glob("*.json"))}
    lines = [
        "# Experiments",
        "",
        "Tables and figures of the dissertation, reproduced by `tools/experiments [NAME... | all]`; "
        "written by it.",
        "`reproduced`: every finding stated on the page holds; `shown`: drawn, with nothing to hold it to.",
        "",
        "| of [T] | what | status | experiment |",
        "|---|---|---|---|",
    ]
    targets = dict(coverage.TARGETS)
    for record in records.values():
        for target in record["covers"]:
            targets.setdefault(target, record["title"])
    for target, what in targets.items():
        word, links = status(target, records)
        lines.append(f"| {target} | {what} | {word} | {links} |")
    return "\n".join(lines) + "\n"
