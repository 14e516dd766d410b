"""python -m equipoise_tools.tally NAME=STATUS=JUNIT_XML...: one line over several test programs' reports.

STATUS is the program's exit status: one that failed without a failed test in its report counts as a failure.
"""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as xml
from dataclasses import dataclass, field
from pathlib import Path

from .entry import leave


@dataclass
class Tally:
    passed: int = 0
    failed: list[str] = field(default_factory=list)
    skipped: list[tuple[str, str]] = field(default_factory=list)


def _skip_reason(case: xml.Element, skipped: xml.Element) -> str:
    """pytest says why in the attribute; of ctest we read the line that GoogleTest prints before SKIPPED."""
    message = skipped.get("message", "")
    if message.startswith("SKIP_"):
        output = case.findtext("system-out") or ""
        found = re.search(r"Skipped\n+(.*)", output)
        return found[1].strip() if found else "no reason given"
    return message


def add_report(tally: Tally, program: str, status: int, report: Path) -> None:
    failed_before = len(tally.failed)
    cases = xml.parse(report).getroot().iter("testcase") if report.is_file() else []
    for case in cases:
        name = f"{program}: {case.get('name')}"
        skipped = case.find("skipped")
        # ctest also calls "notrun" what it could not start (a missing binary): that is a failure.
        asked_to_skip = skipped is not None and skipped.get("message", "").startswith(("SKIP_", "Disabled"))
        not_run = case.get("status") == "notrun" and not asked_to_skip
        if case.find("failure") is not None or case.find("error") is not None or not_run:
            tally.failed.append(name)
        elif skipped is not None:
            tally.skipped.append((name, _skip_reason(case, skipped)))
        else:
            tally.passed += 1
    if not report.is_file():
        tally.failed.append(f"{program}: ended with status {status} and left no report")
    elif status != 0 and len(tally.failed) == failed_before:
        tally.failed.append(f"{program}: ended with status {status}")


def main(arguments: list[str]) -> int:
    tally = Tally()
    for argument in arguments:
        program, status, report = argument.split("=", 2)
        add_report(tally, program, int(status), Path(report))
    for name, reason in tally.skipped:
        print(f"skipped: {name}: {reason}")
    for name in tally.failed:
        print(f"failed:  {name}")
    print(f"{tally.passed} passed, {len(tally.failed)} failed")
    return 1 if tally.failed else 0


if __name__ == "__main__":
    leave(lambda: main(sys.argv[1:]))
