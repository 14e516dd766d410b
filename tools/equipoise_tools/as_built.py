"""python -m equipoise_tools.as_built --mbbr DIR --mip DIR [--robots N] [--steps-only] [--out DIR]

Writes docs/reports/as-built.md and its pictures: errors of whole populations (two campaigns of
tools/campaign, one per robot type), and the same robots with one filter and controller after the other.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

from . import style
from .campaign import read_parts
from .campaign_page import _column, at_point, error_table, points_of, survival_table
from .campaign_statistics import survival_over_time
from .paths import UserError, repository_root
from .style import plt
from .trials import run_trials

POINT = (1.0, 0.2)  # Hz, m/s
DURATION_S = 60.0
# What estimates and what controls, from the dissertation's to ours.
STEPS = (
    ("published EKF, published gains", "ekf13_published", "thesis"),
    ("corrected EKF, published gains", "ekf13", "thesis"),
    ("corrected EKF, scheduled gains", "ekf13", "scheduled"),
    ("default EKF (delay, mount, scale), scheduled gains", "ekf", "scheduled"),
)
LIMITS = {"attitude_rmse_rad": 0.010, "yaw_frame_speed_rmse_m_s": 0.015}  # 95 % of the robots, up to 1.5 Hz


def steps(robots: range) -> list[tuple[str, list[dict]]]:
    """The same robots, step by step."""
    found = []
    for name, estimator, controller in STEPS:
        common = {"seed": 1, "yaw_hz": POINT[0], "drive_mps": POINT[1], "duration_s": DURATION_S}
        choice = {"fidelity": "full", "estimator": estimator, "controller": controller}
        asked = [{"robot": robot, **common, **choice} for robot in robots]
        found.append((name, run_trials("config/mbbr.toml", asked)))
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
Written by `python -m equipoise_tools.as_built` from two campaigns of `tools/campaign` ({robots}, one
run of 60 s per robot and point, seed 1, world `full`, firmware of {commit}). No parameter was chosen
on these robots. In brackets: 95 % interval. What the numbers mean: [as-built.md](../as-built.md).

## Upright and errors
"""
STEPS_HEAD = "## Filter and controller, step by step\n"


def commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    done = subprocess.run(command, cwd=repository_root(), capture_output=True, text=True, check=False)
    return done.stdout.strip() or "an unknown commit"


def population_part(campaigns: dict[str, list[dict]]) -> str:
    robots = "; ".join(
        f"{name} {min(r['robot'] for r in rows)} to {max(r['robot'] for r in rows)}"
        for name, rows in campaigns.items()
    )
    tables = "\n".join(
        "\n".join([f"{name}:", "", *survival_table(rows), "", *error_table(rows), ""])
        for name, rows in campaigns.items()
    )
    picture = "![Errors over the population](as_built_population.png)\n\n"
    return HEAD.format(robots=f"robots {robots}", commit=commit()) + tables + "\n" + picture


def steps_part(found: list[tuple[str, list[dict]]], first: int) -> str:
    where = f"{POINT[0]:g} Hz and {POINT[1]:g} m/s, {DURATION_S:.0f} s"
    robots = f"The same {len(found[0][1])} robots ({first} to {first + len(found[0][1]) - 1}), {where}.\n\n"
    picture = "\n\n![Robots still upright over time, step by step](as_built_steps.png)\n"
    return STEPS_HEAD + robots + "\n".join(steps_table(found)) + picture


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.as_built", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--mbbr", type=Path, help="folder of a campaign with the MBBR")
    parser.add_argument("--mip", type=Path, help="folder of a campaign with the eduMIP")
    parser.add_argument("--robots", type=int, default=20, help="robots of the step-by-step comparison")
    parser.add_argument("--first-robot", type=int, default=201)
    parser.add_argument("--steps-only", action="store_true", help="leave the population's tables as they are")
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "reports")
    given = parser.parse_args(words)
    if not given.steps_only and (given.mbbr is None or given.mip is None):
        parser.error("--mbbr DIR and --mip DIR are needed, or --steps-only")
    page = given.out / "as-built.md"
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        if given.steps_only:
            population = page.read_text(encoding="utf-8").partition(STEPS_HEAD)[0]
        else:
            campaigns = {"MBBR": read_parts(given.mbbr), "eduMIP": read_parts(given.mip)}
            for folder, rows in zip((given.mbbr, given.mip), campaigns.values(), strict=True):
                if not rows:
                    raise UserError(
                        f"{folder}: holds no trials; make them with tools/campaign --out {folder}"
                    )
            draw_population(campaigns["MBBR"], given.out)
            population = population_part(campaigns)
        found = steps(range(given.first_robot, given.first_robot + given.robots))
        draw_steps(found, given.out)
        page.write_text(population + steps_part(found, given.first_robot), encoding="utf-8")
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
