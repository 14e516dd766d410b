"""python -m equipoise_tools.reasons [--out FILE]

Writes docs/reasons.md: why the motors are off and which sensors are excluded, with value, limit and remedy,
from the firmware's table (src/app/text/reasons.cpp) and its configurations.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from .entry import leave
from .names import Reason, rows_of
from .parameters import ROBOTS, keys_of, shown
from .paths import repository_root

TABLE = Path("src/app/text/reasons.cpp")
HEAD = f"""# Reasons
Written by `python -m equipoise_tools.reasons` from the firmware's table ([reasons.cpp](../{TABLE})).
Summary, log, journal, JSON (`reasons`, `degraded`) and the cockpit use these names. Where a reason has a
value it is shown with its limit: `tilt 0.31 rad, limit 0.20 rad: hold it upright before arming`.
Limits are those of {{robots}}, in this order where they differ; their meaning is in
[parameters](parameters.md#safety).
"""
TITLES = {"safety_reasons": "Why the motors are off", "degraded_modes": "Excluded sensors"}
LEADS = {
    "safety_reasons": "Each of these disarms, or prevents arming.",
    "degraded_modes": "The robot keeps balancing, slower where stated ([faults](faults.md)).",
}
_KEY = re.compile(r"\bsafety\.\w+")


def limits(row: Reason, facts: dict[str, dict[str, dict]]) -> list[str]:
    """Every limit that the row compares with or names, and its value for each robot."""
    value_of = {key: what for what, key in row.limits}
    found = []
    for key in dict.fromkeys([*value_of, *_KEY.findall(row.text)]):
        values = [shown(facts[robot][key]["value"]) for robot in ROBOTS if key in facts[robot]]
        unit = next((facts[robot][key]["unit"] for robot in ROBOTS if key in facts[robot]), None)
        number = values[0] if len(set(values)) == 1 else ", ".join(values)
        what = f"{value_of[key]}: " if key in value_of else ""
        found.append(f"{what}`{key}` {number}{' ' + unit if unit else ''}")
    return found


def page(source: str, facts: dict[str, dict[str, dict]]) -> str:
    lines = [HEAD.format(robots=" and ".join(f"the {name}" for name in ROBOTS.values()))]
    for function, title in TITLES.items():
        rows = rows_of(source, function)
        lines += [f"## {title}", LEADS[function], "", "| reason | bit | meaning | value and limit | remedy |"]
        lines.append("|---|---|---|---|---|")
        for bit, row in enumerate(rows):
            told = "; ".join(limits(row, facts))
            lines.append(f"| `{row.name}` | {bit} | {row.text} | {told} | {row.remedy} |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.reasons", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "reasons.md")
    given = parser.parse_args(arguments)
    facts = {robot: keys_of(robot) for robot in ROBOTS}
    table = (repository_root() / TABLE).read_text(encoding="utf-8")
    given.out.write_text(page(table, facts), encoding="utf-8")
    print(given.out)
    return 0


if __name__ == "__main__":
    leave(main)
