"""python -m equipoise_tools.which_world_page [--minutes N] [--write]

Which simulated worlds agree with what [T] says of the real MBBR? Parameters of the world and conventions of
the prints are drawn and kept by how near their runs come to [T]'s; then our firmware runs in the worlds kept.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from .entry import leave
from .experiments.control import CONDITIONS
from .experiments.table_6_1 import WITHIN
from .inference import Draw, Inference, effective, quantiles, weights_of
from .paths import UserError, commit_and_date, repository_root
from .which_world import DURATION_S, FAR, LOST_S, PARAMETERS, Row, rows_of_t, run_rows, trials, world_settings

PAGE = "docs/reports/which-world.md"


def number(value: float) -> str:
    return f"{value:.3g}"


def parameters_table(found: Inference) -> list[str]:
    weights = weights_of(found.kept)
    lines = ["| parameter | prior | median | 5 to 95 % | prior's over it |", "|---|---|--:|--:|--:|"]
    for parameter in (p for p in found.parameters if not p.choices):
        i = found.parameters.index(parameter)
        low, middle, high = quantiles([d.shares[i] for d in found.kept], weights)
        shown = [number(float(parameter.value(s))) for s in (low, middle, high)]
        name = parameter.name + (f", {parameter.unit}" if parameter.unit else "")
        prior = f"{parameter.low:g} to {parameter.high:g}"
        lines.append(
            f"| {name} | {prior} | {shown[1]} | {shown[0]} to {shown[2]} "
            f"| {0.9 / max(high - low, 1e-3):.1f} |"
        )
    lines += ["", "| convention | share of the kept draws (prior: half) |", "|---|---|"]
    for parameter in (p for p in found.parameters if p.choices):
        i = found.parameters.index(parameter)
        chosen = np.array([parameter.value(d.shares[i]) for d in found.kept])
        shares = [f"{choice} {100 * weights[chosen == choice].sum():.0f} %" for choice in parameter.choices]
        lines.append(f"| {parameter.name} | {', '.join(shares)} |")
    return lines


def agrees(row: Row, quantity: str, draw: Draw) -> bool:
    return row.off(quantity, draw.ran[row.name]) <= 1.0


WORDS = {
    "upright_s": "upright, s",
    "attitude_rmse_rad": "tilt error, rad",
    "ball_speed_rmse_m_s": "ball speed error, m/s",
}


def printed_of(row: Row, quantity: str) -> str:
    if quantity != "upright_s":
        return f"{row.printed[quantity]:g}"
    return "stood" if row.stood else f"lost, {LOST_S[0]:g} to {LOST_S[1]:g}"


def predicted(row: Row, quantity: str, draws: list[Draw]) -> str:
    """Median and 5 to 95 % over draws; of errors, those that stood."""
    there = [d for d in draws if quantity == "upright_s" or d.ran[row.name]["upright_s"] >= DURATION_S]
    there = [d for d in there if d.ran[row.name][quantity] is not None]
    if not there:
        return "none stood"
    low, middle, high = quantiles([d.ran[row.name][quantity] for d in there], weights_of(there))
    return f"{number(middle)} ({number(low)} to {number(high)})"


def rows_table(found: Inference) -> list[str]:
    lines = [
        "| row | | [T] | kept draws: median (5 to 95 %) | agree | row left out: median (5 to 95 %) | agree "
        "| of all draws agree |",
        "|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    for row in found.rows:
        without = found.left_out(row.name)
        for quantity in row.quantities():
            cells = [row.name, WORDS[quantity], printed_of(row, quantity)]
            for draws in (found.kept, without):
                share = weights_of(draws) @ np.array([agrees(row, quantity, d) for d in draws])
                cells += [predicted(row, quantity, draws), f"{100 * share:.0f} %"]
            cells.append(str(sum(agrees(row, quantity, d) for d in found.draws)))
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def exclusions(found: Inference, at_least: int = 10) -> list[str]:
    """Pairs of statements that many draws meet, and none both; statements that none meets."""
    statements = [(row, q) for row in found.rows for q in row.quantities()]
    met = np.array([[agrees(row, q, d) for row, q in statements] for d in found.draws])
    names = [f"{row.name}: {WORDS[q]} {printed_of(row, q)}" for row, q in statements]
    counts = met.sum(axis=0)
    most = met.sum(axis=1).argmax()
    lines = [
        f"The draw that meets most statements meets {met[most].sum()} of {len(statements)}; not these:",
        "",
    ]
    lines += [f"- {name}" for name, hit in zip(names, met[most], strict=True) if not hit]
    lines += ["", "Statements that no draw meets:", ""]
    lines += [f"- {name}" for name, n in zip(names, counts, strict=True) if n == 0] or ["- none"]
    pairs = [
        (counts[i] * counts[j] / len(met), i, j)
        for i, j in itertools.combinations(range(len(statements)), 2)
        if min(counts[i], counts[j]) >= at_least and not np.any(met[:, i] & met[:, j])
    ]
    lines += [
        "",
        f"Pairs of which {at_least} draws or more meet each and none meets both, by what chance would give:",
        "",
    ]
    lines += ["| statement | draws | and | draws | both, if independent |", "|---|--:|---|--:|--:|"]
    for chance, i, j in sorted(pairs, reverse=True)[:20]:
        lines.append(f"| {names[i]} | {counts[i]} | {names[j]} | {counts[j]} | {chance:.1f} |")
    if not pairs:
        lines.append("| none | | | | |")
    return lines


OURS = ((0.0, 0.0), (0.0, 0.2), *CONDITIONS)


def firmware_table(found: Inference) -> list[str]:
    """Our firmware as it stands, its detection on, in every kept world."""
    asked = [
        {"yaw_hz": hz, "drive_mps": drive, "duration_s": DURATION_S, "fidelity": "nominal"}
        for hz, drive in OURS
    ]

    def one(i: int) -> list[dict]:
        settings = world_settings(found.values(found.kept[i].shares))
        return trials(settings, [row | {"seed": 10_000 + i} for row in asked])

    with ThreadPoolExecutor(found.jobs) as pool:
        ran = list(pool.map(one, range(len(found.kept))))
    weights = weights_of(found.kept)
    lines = [
        "| yaw Hz, m/s | upright | worlds | tilt error, rad | ball speed error, yaw frame, m/s | lost by |",
        "|---|--:|--:|--:|--:|---|",
    ]
    for i, (hz, drive) in enumerate(OURS):
        here = [rows[i] for rows in ran]
        stood = np.array([not row["fell"] for row in here])
        cells = [f"{hz:g}, {drive:g}", f"{100 * weights @ stood:.0f} %", f"{stood.sum()} of {len(here)}"]
        for quantity in ("attitude_rmse_rad", "yaw_frame_speed_rmse_m_s"):
            if not stood.any():
                cells.append("none stood")
                continue
            values = [row[quantity] for row, up in zip(here, stood, strict=True) if up]
            low, middle, high = quantiles(values, weights[stood] / weights[stood].sum())
            cells.append(f"{number(middle)} ({number(low)} to {number(high)})")
        lost = [(row["reasons"] or [row["ended"]])[0] for row in here if row["fell"]]
        cells.append(", ".join(f"{why} {lost.count(why)}" for why in sorted(set(lost))))
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def page(found: Inference, firmware: list[str]) -> str:
    lines = [
        "# Which world is like [T]'s robot?",
        "",
        "The only measurements of the real MBBR are [T]'s: where it stood, fell, and its filters' errors. "
        f"Of {len(found.parameters)} parameters and conventions, {len(found.draws)} draws "
        f"were simulated ({DURATION_S:g} s each, one seed a draw); {len(found.kept)} are kept, worth "
        f"{effective(found.kept):.0f} independent ones by their weights: where few, intervals say where good "
        "draws lie, not how likely they are. An error agrees within "
        f"{100 * WITHIN:.0f} %. "
        "Distance: mean over all statements, 1 where it just agrees, "
        f"{FAR:g} at most; kept are {found.kept[0].distance:.2f} to {found.kept[-1].distance:.2f}. "
        "The attitude of DMP+KF is put in with 0.010 rad of noise.",
        "",
        "Written by `tools/lab world --write` at {}, {}.".format(*commit_and_date()),
        "",
        "## What the kept draws say",
        "",
        *parameters_table(found),
        "",
        "## Row by row",
        "",
        "Left out: the draws nearest to all other rows. Proposals had seen it; weights allow for that.",
        "",
        *rows_table(found),
        "",
        "## What excludes what",
        "",
        *exclusions(found),
        "",
        "## Our firmware in the kept worlds",
        "",
        f"The shipped configuration with its detection, {DURATION_S:g} s, another seed.",
        "",
        *firmware,
    ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tools/lab world", description=__doc__)
    parser.add_argument("--minutes", type=float, default=40.0, help="no generation begins later")
    parser.add_argument("--size", type=int, default=180, help="draws of the first generation")
    parser.add_argument("--keep", type=int, default=60, help="of each; the next has SIZE - KEEP new ones")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--out",
        type=Path,
        default=repository_root() / "build" / "which-world",
        help="draws; goes on with what it has",
    )
    parser.add_argument("--write", action="store_true", help=f"into {PAGE}, not to standard output")
    given = parser.parse_args(arguments)
    if not 2 <= given.keep < given.size:
        parser.error("--keep: from 2 to less than --size")
    rows = rows_of_t()
    found = Inference(
        PARAMETERS,
        rows,
        lambda at, seed: run_rows(rows, at, seed),
        given.size,
        given.keep,
        given.seed,
        given.jobs,
    )
    given.out.mkdir(parents=True, exist_ok=True)
    done = given.out / "draws.json"
    if done.exists():
        found.draws = [Draw(*row) for row in json.loads(done.read_text())]
    began = time.monotonic()
    try:
        while time.monotonic() - began < 60 * given.minutes:
            share = found.step(began + 60 * given.minutes)
            rows_done = [[d.shares, d.ran, d.weight, d.distance] for d in found.draws]
            done.with_suffix(".part").write_text(json.dumps(rows_done))
            done.with_suffix(".part").rename(done)
            print(
                f"{time.monotonic() - began:.0f} s: {len(found.draws)} draws, "
                f"distance {found.kept[0].distance:.2f} to {found.kept[-1].distance:.2f}, "
                f"{100 * share:.0f} % of the last kept",
                file=sys.stderr,
                flush=True,
            )
            if share < 0.05:
                break
        text = page(found, firmware_table(found))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if given.write:
        (repository_root() / PAGE).write_text(text, encoding="utf-8")
        print(repository_root() / PAGE)
    else:
        print(text)
    return 0


if __name__ == "__main__":
    leave(main)
