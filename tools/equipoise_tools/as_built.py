"""python -m equipoise_tools.as_built DIR... [--robots N] [--out DIR]

Writes docs/reports/as-built.md and its pictures: who stays upright, by how much it errs, what makes it fall
and the worst cases of each campaign of tools/campaign; and the same robots with one filter and controller
after the other. Parts of the page that no DIR is about stay. The first campaign's errors are drawn.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

import numpy as np

from . import style
from .campaign import read_parts
from .campaign_page import (
    ERRORS,
    _column,
    at_point,
    engine_of,
    error_table,
    points_of,
    reasons_table,
    sensitivity,
    survival_table,
    worst_cases,
)
from .campaign_statistics import survival_over_time
from .experiments.runs import LOSSLESS
from .parameters import ROBOTS
from .paths import UserError, commit_and_date, repository_root
from .style import plt
from .trials import run_trials

POINT = (1.0, 0.2)  # Hz, m/s
DURATION_S = 60.0
WORLD = "built2025"  # in `full` all but the last fall at once
WORST = 2
# What estimates and what controls, from the dissertation's to ours.
STEPS = (
    ("published EKF, published gains", "ekf13_published", "thesis"),
    ("corrected EKF, published gains", "ekf13", "thesis"),
    ("corrected EKF, scheduled gains", "ekf13", "scheduled"),
    ("default EKF (delay, mount, scale), scheduled gains", "ekf", "scheduled"),
)
THESIS = (
    "Published gains: [T]'s, with our sign of (6.13), body rates, inertial filters and acceleration limit; "
    "without these: [control](../experiments/control.md)."
)
LIMITS = {"attitude_rmse_rad": 0.010, "yaw_frame_speed_rmse_m_s": 0.015}  # 95 % of the robots, up to 1.5 Hz


def steps(robots: range) -> list[tuple[str, list[dict]]]:
    """The same robots, step by step."""
    found = []
    for name, estimator, controller in STEPS:
        common = {"seed": 1, "yaw_hz": POINT[0], "drive_mps": POINT[1], "duration_s": DURATION_S}
        choice = {"fidelity": WORLD, "estimator": estimator, "controller": controller}
        asked = [{"robot": robot, **common, **choice} for robot in robots]
        found.append((name, run_trials("config/mbbr.toml", asked, LOSSLESS)))
    return found


def steps_table(found: list[tuple[str, list[dict]]]) -> list[str]:
    lines = [
        "| in control | upright for 60 s | median time upright | attitude error of the upright, median |",
        "|---|---|---|---|",
    ]
    for name, rows in found:
        errors = _column([row for row in rows if not row["fell"]], "attitude_rmse_rad")
        times = [row["fell_at_s"] if row["fell"] else DURATION_S for row in rows]
        error = f"{np.median(errors):.4f} rad" if len(errors) else "-"
        lines.append(f"| {name} | {len(errors)} of {len(rows)} | {np.median(times):.1f} s | {error} |")
    return lines


def draw_steps(found: list[tuple[str, list[dict]]], out: Path) -> None:
    with style.styled():
        figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
        for i, (name, rows) in enumerate(found):
            times, left = survival_over_time(_column(rows, "fell_at_s"), DURATION_S)
            last = i == len(found) - 1
            axes.step(
                times,
                100 * left,
                where="post",
                label=name,
                color=style.ESTIMATE if last else style.OTHERS[i],
                linestyle=style.dash(i),
                linewidth=2.0 if last else 1.2,
            )
        axes.set(
            xlabel="time since the start, s",
            ylabel="robots still upright, %",
            xlim=(0, DURATION_S),
            ylim=(-2, 103),
            title=f"The same {len(found[0][1])} built robots, {POINT[0]:g} turn a second at {POINT[1]:g} m/s",
        )
        style.legend_above(figure, axes, columns=2)
        style.save(figure, out / "as_built_steps")


def draw_population(rows: list[dict], out: Path) -> None:
    """Share of the robots whose error is below a value, per point."""
    with style.styled():
        figure, panels = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
        for axes, (key, title, scale) in zip(
            panels,
            (
                ("attitude_rmse_rad", "attitude error (RMS), rad", 1.0),
                ("yaw_frame_speed_rmse_m_s", "speed error (RMS), cm/s", 100.0),
            ),
            strict=True,
        ):
            for i, point in enumerate(points_of(rows)):
                values = np.sort(scale * _column(at_point(rows, point), key))
                values = values[np.isfinite(values)]
                share = 100 * np.arange(1, len(values) + 1) / max(len(values), 1)
                label = f"{point[0]:g} Hz, {point[1]:g} m/s"
                axes.plot(values, share, label=label, color=style.OTHERS[i % 6], linestyle=style.dash(i))
            axes.axhline(95, color="#999999", linewidth=0.8)
            axes.axvline(scale * LIMITS[key], color=style.TRUTH, linewidth=0.8, linestyle=":")
            axes.set(xlabel=title, ylabel="robots below, %", xlim=(0, None), ylim=(0, 101))
        style.legend_above(figure, panels[0])
        style.save(figure, out / "as_built_population")


HEAD = """# Population of robots as built: tables
Written by `python -m equipoise_tools.as_built`; each part has its commit and date. Each robot is drawn from
its type's population; in brackets: 95 % interval; errors are of those upright to the end, after 5 s. What the
numbers mean: [as-built.md](../as-built.md).

"""
STEPS_HEAD = "## Filter and controller, step by step\n"


def where_it_is(rows: list[dict]) -> str:
    yaw, drive = max(points_of(rows))
    upright = [row for row in at_point(rows, (yaw, drive)) if not row["fell"]]
    keys = ("position_rmse_m", "heading_error_rad")
    off_m, turned = (np.nanmedian(np.abs(_column(upright, key))) for key in keys)
    return (
        f"At {yaw:g} Hz and {drive:g} m/s the median robot that stands is {off_m:.2f} m from where it should "
        f"be and turned by {turned:.2f} rad at the end: it knows its tilt and speed, not where it is."
    )


def campaign_part(rows: list[dict], settings: dict, made: str) -> str:
    """`made`: the command, commit and day of the campaign."""
    robot = Path(settings["config"]).stem
    lines = [f"## {ROBOTS.get(robot, robot)}, world `{settings['fidelity']}`{engine_of(settings)}", made, ""]
    lines += [*survival_table(rows), "", *error_table(rows, ERRORS[:2]), "", where_it_is(rows), ""]
    if any(row["fell"] for row in rows):
        lines += ["### Why the motors went off", *reasons_table(rows), ""]
    lines += ["### Which imperfection it is", *sensitivity(rows), ""]
    lines += ["### Worst cases", *worst_cases(rows, settings, WORST), ""]
    return "\n".join(lines) + "\n"


def steps_part(found: list[tuple[str, list[dict]]], first: int) -> str:
    where = f"{POINT[0]:g} Hz and {POINT[1]:g} m/s, {DURATION_S:.0f} s, world `{WORLD}`"
    where += ", at {}, {}".format(*commit_and_date())
    robots = f"The same {len(found[0][1])} robots ({first} to {first + len(found[0][1]) - 1}), {where}.\n"
    robots += f"{THESIS}\n\n"
    picture = "\n\n![Robots still upright over time, step by step](as_built_steps.png)\n"
    return STEPS_HEAD + robots + "\n".join(steps_table(found)) + picture


def renewed(page: str, parts: list[str]) -> str:
    """The page with these parts in place of those under the same headings, or after them."""
    found = {part.split("\n", 1)[0]: part for part in re.split(r"^(?=## )", page, flags=re.MULTILINE)[1:]}
    found |= {part.split("\n", 1)[0]: part for part in parts}
    last = found.pop(STEPS_HEAD.strip(), "")
    return HEAD + "".join(found.values()) + last


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.as_built", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("campaigns", nargs="+", type=Path, metavar="DIR", help="folder of a campaign")
    parser.add_argument("--robots", type=int, default=20, help="robots of the step-by-step comparison")
    parser.add_argument("--first-robot", type=int, default=201)
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "reports")
    given = parser.parse_args(words)
    page = given.out / "as-built.md"
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        parts = []
        for folder in given.campaigns:
            rows = read_parts(folder)
            if not rows:
                raise UserError(f"{folder}: holds no trials; make them with tools/campaign --out {folder}")
            if not parts:
                draw_population(rows, given.out)
            page_lines = (folder / "campaign.md").read_text(encoding="utf-8").splitlines()
            made = next(line for line in page_lines if line.startswith("Made by"))
            parts.append(campaign_part(rows, json.loads((folder / "campaign.json").read_text()), made))
        found = steps(range(given.first_robot, given.first_robot + given.robots))
        draw_steps(found, given.out)
        parts[0] += "![Errors of these robots](as_built_population.png)\n\n"
        before = page.read_text(encoding="utf-8") if page.exists() else ""
        page.write_text(renewed(before, [*parts, steps_part(found, given.first_robot)]), encoding="utf-8")
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
