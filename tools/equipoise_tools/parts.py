"""python -m equipoise_tools.parts [--out FILE]

Writes docs/reports/parts.md: the printed bodies' parts, what they come to against the configurations, and
motors against the region of operation, each number with its source.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from equipoise_robot import run
from equipoise_robot.body import PLA_KG_M3, assemble, dimensions, fragment
from equipoise_robot.shapes import OMNIWHEEL_M

from .entry import leave
from .experiments import motor_selection as region
from .paths import repository_root

HEAD = """# Parts: numbers and their sources
Written by `python -m equipoise_tools.parts`. Lengths are of the printed bodies that
`python -m equipoise_robot.body` draws around the configured wheels; none has been built. What no source
gives is unknown: measure yours, `--mass PART=KG`, `--size PART=M,M,M`.
"""
NAMES = {"mbbr": "MBBR", "mip": "eduMIP"}
ROBOTS_TRIED, SECONDS = 20, 20.0
OZ_IN, KG_CM = 0.0070616, 0.0980665  # N m


@dataclass(frozen=True)
class Motor:
    """At the gear's shaft, at its rated voltage."""

    name: str
    stall_N_m: float
    no_load_rpm: float
    rated_V: float
    stall_A: float
    counts: float  # of its encoder, per turn of the shaft
    source: str


MOTORS = (
    Motor(
        "CL-FF180SH behind 12:1, [T]",
        *region.identified(12),
        region.BATTERY_V,
        region.BATTERY_V / region.RESISTANCE_OHM,
        720.0,
        "`[motor]`, [T] 6.2.3; 2.3.4. Not sold",
    ),
    Motor(
        "Pololu 25D 4.4:1 HP 6 V",
        1.2 * KG_CM,
        2200.0,
        6.0,
        6.0,
        211.2,
        "maker's page of item 4801",
    ),
    Motor(
        "Pololu 25D 9.7:1 HP 6 V",
        39 * OZ_IN,
        990.0,
        6.0,
        6.5,
        464.64,
        "a reseller's table of the series; the maker's newer data were not seen",
    ),
)


def bodies() -> list[str]:
    lines = []
    for robot, name in NAMES.items():
        body, (_, d) = assemble(robot), dimensions(robot)
        lines += [
            f"## {name}: parts of the printed body",
            "",
            "| part | mm | g | source |",
            "|---|---|---|---|",
        ]
        for part in body.parts:
            if part.printed:
                low, high = np.split(1e3 * np.array(part.solid.bounding_box()), 2)
                mm = " x ".join(f"{edge:.0f}" for edge in high - low)
                grams = 1e3 * PLA_KG_M3 * part.solid.volume()
                lines.append(
                    f"| {part.name} | {mm} | {grams:.0f} | ours, solid PLA of {PLA_KG_M3:.0f} kg/m3 |"
                )
        number = {part.name: sum(p.name == part.name for p in body.parts) for part in body.parts}
        for label, bought in body.bought.items():
            wheel = 2 * d.get("wheel_radius_m", 0.0)
            mm = " x ".join(f"{1e3 * (edge or wheel):.1f}" for edge in bought.size_m)
            mass = "unknown" if bought.mass_kg is None else f"{1e3 * bought.mass_kg:.0f}"
            lines.append(f"| {number[label]} {label} | {mm} | {mass} | {bought.source} |")
        lines += [
            "",
            "With the unknown parts at one density, the one that makes up the configured mass "
            f"({body.shared_kg_m3:.0f} kg/m3); behind #: what is configured, and how far this is from it:",
            "",
            "```toml",
            *fragment(body).splitlines()[3:],
            "```",
            "",
        ]
    return lines


def stood(robot: str) -> tuple[int, int]:
    """Of the drawn robots, as configured and with the printed body: upright to the end."""
    with tempfile.TemporaryDirectory() as folder:
        printed = Path(folder) / "printed.toml"
        printed.write_text(fragment(assemble(robot)))
        counts = [
            sum(
                run(
                    config,
                    yaw_hz=0.3,
                    drive_mps=0.1,
                    duration_s=SECONDS,
                    seed=number,
                    fidelity="built2025",
                    robot_number=number,
                ).ended
                == "finished"
                for number in range(1, ROBOTS_TRIED + 1)
            )
            for config in (robot, printed)
        ]
    return counts[0], counts[1]


def trials() -> list[str]:
    lines = [
        "## Simulated robots with the printed body",
        f"Simulated in `built2025`, robots 1 to {ROBOTS_TRIED} of the population, {SECONDS:.0f} s at "
        "0.1 m/s and 0.3 Hz, gains designed for each `[robot]`, noise as configured; upright to the end:",
        "",
        "| robot | as configured | printed body |",
        "|---|---|---|",
    ]
    for robot, name in NAMES.items():
        shipped, printed = stood(robot)
        lines.append(f"| {name} | {shipped} of {ROBOTS_TRIED} | {printed} of {ROBOTS_TRIED} |")
    return [*lines, ""]


def motors() -> list[str]:
    needed = region.wheel_torque_N_m(np.radians(30), np.array(dimensions("mbbr")[1]["wheel_axes"]).T)
    lines = [
        "## Motors for the MBBR",
        f"At the wheel and {region.BATTERY_V} V, torque and speed in proportion to the voltage. [T]'s "
        f"region of operation is {region.REGION_N_M} N m at {region.REGION_RPM:.0f} rpm "
        "([experiment](../experiments/motor_selection.md)); "
        f"holding 30° of tilt takes {needed:.3f} N m of the most loaded wheel. Margins: what the motor "
        "gives over what is needed. A motor that stalls at more than the MC33926's 3 A needs another bridge.",
        "",
        "| motor | stall, N m | no load, rpm | at 600 rpm, N m | margin | stall over 30° | stall, A | counts "
        "per turn | source |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for motor in MOTORS:
        scale = region.BATTERY_V / motor.rated_V
        stall, no_load = scale * motor.stall_N_m, scale * motor.no_load_rpm
        torque, _ = region.margins(stall, no_load)
        lines.append(
            f"| {motor.name} | {stall:.3f} | {no_load:.0f} | {torque:.3f} | "
            f"{torque / region.REGION_N_M:.2f} | {stall / needed:.2f} | {scale * motor.stall_A:.1f} | "
            f"{motor.counts:g} | {motor.source} |"
        )
    return [*lines, ""]


def wheels() -> list[str]:
    _, d = dimensions("mbbr")
    spacing, radius = OMNIWHEEL_M / 2, d["ball_radius_m"]
    return [
        "## Omniwheels for the MBBR",
        f"`omniwheel_hub.stl` and twelve `omniwheel_roller.stl` make a wheel of "
        f"{2e3 * d['wheel_radius_m']:.0f} mm, with pins of 1 mm wire; rows {1e3 * spacing:.0f} mm apart "
        f"tilt the torque's axis by {spacing / 2 / radius:.3f} rad, [T] (2.1): "
        "`disturbance.roller_tilt_rad`. Rollers need a rubber coat for grip. Mass, grip and wear: unknown.",
    ]


def page() -> str:
    return "\n".join([HEAD, *bodies(), *trials(), *motors(), *wheels()]) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.parts", description="Writes docs/reports/parts.md."
    )
    parser.add_argument("--out", type=Path, default=repository_root() / "docs/reports/parts.md")
    out = parser.parse_args(arguments).out
    out.write_text(page(), encoding="utf-8")
    print(out)
    return 0


if __name__ == "__main__":
    leave(main)
