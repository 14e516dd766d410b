"""python -m equipoise_tools.as_built --mbbr DIR --mip DIR [--robots N] [--out DIR]

The pictures and tables of docs/as-built.md: what it takes to keep a typical built robot upright (the same
robots with one filter and controller after the other), and what comes of a whole population (two campaigns
of tools/campaign, one per robot type).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import style
from .campaign import binary, read_parts
from .campaign_page import _column, at_point, error_table, points_of, survival_table
from .campaign_statistics import survival_over_time, wilson
from .paths import UserError, repository_root
from .style import plt

POINT = (1.0, 0.2)  # Hz, m/s
DURATION_S = 60.0
# What estimates and what controls, from the dissertation's to ours.
STEPS = (
    ("printed filter, printed gains", "ekf13_published", "thesis"),
    ("printed filter corrected, printed gains", "ekf13", "thesis"),
    ("the same, gains that know the delay", "ekf13", "scheduled"),
    ("filter that knows delay, mount and scale", "ekf", "scheduled"),
)
LIMITS = {"attitude_rmse_rad": 0.010, "yaw_frame_speed_rmse_m_s": 0.015}  # 95 % of the robots, up to 1.5 Hz


def trials(rows: list[dict]) -> list[dict]:
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        request = Path(folder) / "trials.json"
        request.write_text(json.dumps({"trials": rows}))
        config = repository_root() / "config" / "mbbr.toml"
        command = [binary(), "trials", "--config", config, "--in", request, "--jobs", os.cpu_count() or 1]
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(done.stderr.strip())
    return json.loads(done.stdout)["trials"]


def steps(robots: range) -> list[tuple[str, list[dict]]]:
    """The same robots, step by step."""
    found = []
    for name, estimator, controller in STEPS:
        common = {"seed": 1, "yaw_hz": POINT[0], "drive_mps": POINT[1], "duration_s": DURATION_S}
        choice = {"fidelity": "full", "estimator": estimator, "controller": controller}
        found.append((name, trials([{"robot": robot, **common, **choice} for robot in robots])))
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


def draw_survival(campaigns: dict[str, list[dict]], out: Path) -> None:
    with style.styled():
        figure, axes = plt.subplots(figsize=(7, 3.4), layout="constrained")
        for i, (name, rows) in enumerate(campaigns.items()):
            points = points_of(rows)
            counts = [(sum(not r["fell"] for r in at_point(rows, p)), len(at_point(rows, p))) for p in points]
            shares = np.array([100 * k / n for k, n in counts])
            bounds = np.array([[100 * x for x in wilson(k, n)] for k, n in counts])
            spread = np.maximum(0.0, np.abs(bounds.T - shares))
            axes.errorbar(
                [p[0] for p in points],
                shares,
                yerr=spread,
                fmt="os"[i],
                capsize=4,
                color=style.colour(i),
                label=f"{name}, {max(n for _, n in counts)} robots",
            )
        axes.set(xlabel="yaw rate, turns a second", ylabel="upright for a minute, %")
        axes.set_ylim(min(95.0, axes.get_ylim()[0]), 100.2)
        style.legend_above(figure, axes)
        style.save(figure, out / "as_built_survival")


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.as_built", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--mbbr", type=Path, required=True, help="folder of a campaign with the MBBR")
    parser.add_argument("--mip", type=Path, required=True, help="folder of a campaign with the eduMIP")
    parser.add_argument("--robots", type=int, default=20, help="robots of the step-by-step comparison")
    parser.add_argument("--first-robot", type=int, default=201)
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "images")
    given = parser.parse_args(words)
    try:
        campaigns = {"MBBR": read_parts(given.mbbr), "eduMIP": read_parts(given.mip)}
        for folder, rows in zip((given.mbbr, given.mip), campaigns.values(), strict=True):
            if not rows:
                raise UserError(f"{folder}: holds no trials; make them with tools/campaign --out {folder}")
        found = steps(range(given.first_robot, given.first_robot + given.robots))
        given.out.mkdir(parents=True, exist_ok=True)
        draw_steps(found, given.out)
        draw_population(campaigns["MBBR"], given.out)
        draw_survival(campaigns, given.out)
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(steps_table(found)))
    for rows in campaigns.values():
        print("\n".join(["", *survival_table(rows), "", *error_table(rows)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
