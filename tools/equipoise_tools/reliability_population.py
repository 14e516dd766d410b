"""Faults of imperfect, held-out robots, and healthy ones that must not be disarmed."""

from __future__ import annotations

import argparse
import json

from .campaign_statistics import wilson
from .reliability_part import BINARY, CONFIGS, Part, output

# Of the robots that no limit was chosen on; the typical one is part of `faults`.
HELD_OUT = 7001
POPULATION_FAULTS = (
    *(f"gyro_{axis}_{what}" for what in ("frozen", "zero", "flipped") for axis in "xyz"),
    *("gyro_xy_swapped", "gyro_yz_swapped", "gyro_zx_swapped", "gyro_ramp", "bias_jump", "noise_burst"),
    *("accel_frozen", "duplicated", "two_encoders_dead", "motor_dead", "motors_swapped", "motor_stuck"),
)
PHASES = ("balancing", "spinning", "driving", "spin_driving")


def of_population(config, faults, robots: int) -> list[dict]:
    """Cases of drawn, imperfect robots."""
    command = [BINARY, "campaign", "--config", config, "--fidelity", "full", "--json", "-"]
    command += ["--robot", HELD_OUT, "--robots", robots]
    for option, values in (("--fault", faults), ("--phase", PHASES)):
        for value in values:
            command += [option, value]
    return json.loads(output(*command, check=False))["cases"]


def found(cases: list[dict]) -> str:
    """When, in ticks after the first faulty one: median and the last, and how many were not."""
    ticks = sorted(c["found_after_ticks"] for c in cases if c["found_after_ticks"] is not None)
    never = len(cases) - len(ticks)
    if not ticks:
        return "not found"
    text = f"{ticks[len(ticks) // 2]} / {ticks[-1]}"
    return f"{text}; {never} of {len(cases)} not" if never else text


def hit_robots(cases: list[dict], what: str) -> tuple[int, int, float]:
    """Cases of one robot are not independent, robots are: how many have any such case, of how many, and the
    upper end of their share in percent."""
    robots = {c["robot"] for c in cases}
    hit = {c["robot"] for c in cases if c[what]}
    return len(hit), len(robots), 100 * wilson(len(hit), len(robots))[1]


def of_robots(cases: list[dict], what: str) -> str:
    hit, robots, high = hit_robots(cases, what)
    return f"{hit} of {robots} robots, below {high:.1f} % of them (95 %)"


def unsafe_ones(cases: list[dict]) -> str:
    """Of each fault in each phase how many, and one robot that can be run again alone
    (`equipoise campaign --robot N --fault NAME --phase NAME`)."""
    alike: dict[str, list[int]] = {}
    for c in cases:
        if c["unsafe"]:
            alike.setdefault(f"{c['fault']}, {c['phase']}: {c['why']}", []).append(c["robot"])
    named = [f"- {kind}: {len(robots)} ({robots[0]})\n" for kind, robots in alike.items()]
    return f"Unsafe (and the first robot):\n\n{''.join(named)}\n" if named else ""


def population(options: argparse.Namespace) -> Part:
    part = Part()
    for robot, config in CONFIGS.items():
        cases = of_population(config, POPULATION_FAULTS, options.robots)
        unsafe = sum(c["unsafe"] for c in cases)
        text = f"{len(cases)} cases, {unsafe} unsafe; {of_robots(cases, 'unsafe')}"
        part.rows.append(
            (
                f"{robot}: {len(POPULATION_FAULTS)} faults × 4 phases, {options.robots} imperfect robots",
                "0 unsafe",
                text,
                unsafe == 0 < len(cases),
            )
        )
        # No fault of a robot that does not use it.
        healthy = of_population(config, ["torn_packet"], options.robots)
        for case in healthy:
            case["alarm"] = case["disarmed"] or bool(case["degraded"]) or not case["upright"]
        alarms = sum(c["alarm"] for c in healthy)
        part.rows.append(
            (
                f"{robot}: healthy imperfect robots",
                "0 disarmed, 0 with a sensor excluded",
                f"{len(healthy)} runs, {alarms} alarms; {of_robots(healthy, 'alarm')}; "
                f"{sum(c['unsafe'] for c in healthy)} of the runs judged unsafe",
                alarms == 0 < len(healthy),
            )
        )
        part.section += (
            f"## {robot}: imperfect robots\nFirst robot {HELD_OUT}, world of full fidelity. Ticks until the "
        )
        part.section += "motors were off or the part was excluded, median / last; robots with an unsafe "
        part.section += "run, their share with 95 %.\n\n"
        part.section += f"| fault | {' | '.join(PHASES)} | unsafe |\n|---|{'---|' * len(PHASES)}---|\n"
        for fault in POPULATION_FAULTS:
            of_fault = [c for c in cases if c["fault"] == fault]
            cells = [found([c for c in of_fault if c["phase"] == phase]) for phase in PHASES]
            hit, _, high = hit_robots(of_fault, "unsafe")
            part.section += f"| {fault} | {' | '.join(cells)} | {hit}, < {high:.1f} % |\n"
        part.section += "\n" + unsafe_ones(cases)
    return part
