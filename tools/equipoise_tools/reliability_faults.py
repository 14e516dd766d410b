"""Every fault in every phase of a run of the typical robot, and the soak."""

from __future__ import annotations

import argparse
import json

from .reliability_part import BINARY, CONFIGS, Part, output


def cell(case: dict) -> str:
    """What came of one case."""
    if case["unsafe"]:
        return f"**UNSAFE: {case['why']}**"
    if case["upright"]:
        return "stays up"
    if case["disarmed"]:
        return f"off by tick {case['off_after_ticks']}: {case['reasons']}"
    return f"stays off: {case['reasons']}"


def table(told: dict, described: bool = True) -> str:
    """A row for each fault, a column for each phase; none for a phase in which all stay off."""
    cells = {(case["fault"], case["phase"]): cell(case) for case in told["cases"]}
    faults, phases = (list(dict.fromkeys(key)) for key in zip(*cells, strict=True))
    phases = [p for p in phases if not all(cells[f, p].startswith("stays off") for f in faults)]
    rows = [f"| fault | {' | '.join(phases)} |", "|---|" + "---|" * len(phases)]
    for fault in faults:
        named = " | ".join(cells[fault, phase] for phase in phases)
        rows.append(f"| {fault}{': ' + told['faults'][fault] if described else ''} | {named} |")
    return "\n".join(rows) + "\n"


def faults(options: argparse.Namespace) -> Part:
    part = Part()
    for robot, config in CONFIGS.items():
        soak_hours = ("--soak-hours", options.soak_hours)
        told = json.loads(
            output(BINARY, "campaign", "--config", config, *soak_hours, "--json", "-", check=False)
        )
        soak = told["soak"]
        cases, unsafe = told["case_count"], told["unsafe"]
        holds = cases >= 60 and unsafe == 0
        part.rows.append(
            (f"{robot}: fault × phase", "60 cases, 0 unsafe", f"{cases} cases, {unsafe} unsafe", holds)
        )
        ended = f"{soak['hours']:.1f} h, {soak['unsafe']} unsafe, {soak['unexplained']} without a cause"
        holds = soak["hours"] >= 10 and soak["unsafe"] == soak["unexplained"] == 0
        part.rows.append((f"{robot}: soak", "10 h, no fall that its fault does not explain", ended, holds))
        to_explain = "".join(f"- {json.dumps(run)}\n" for run in soak["to_explain"])
        part.section += f"## {robot}\n{to_explain}\n{table(told, described=not part.section)}\n"
    return part
