"""Shares with Wilson's interval, differences to ours by a bootstrap over robots, and the page."""

from __future__ import annotations

import numpy as np

from ..campaign_statistics import wilson
from .peers import OURS
from .runs import ENGINES, POINTS

DRAWS = 2000
FEWEST = 5  # robots of which a bootstrap says anything
ALL = "all"


def lasted(row: dict) -> bool:
    return row["ended"] == "finished"


def difference(ours: dict[int, float], theirs: dict[int, float]) -> tuple[float, float, float] | None:
    """Mean of ours minus theirs over robots, and its 95 % interval: runs of a robot are one draw."""
    robots = sorted(ours.keys() & theirs.keys())
    if len(robots) < FEWEST:
        return None
    gaps = np.array([ours[robot] - theirs[robot] for robot in robots])
    drawn = np.random.default_rng(1).integers(len(gaps), size=(DRAWS, len(gaps)))
    low, high = np.quantile(gaps[drawn].mean(axis=1), (0.025, 0.975))
    return float(gaps.mean()), float(low), float(high)


def by_robot(rows: list[dict]) -> dict[int, float]:
    kept: dict[int, list[bool]] = {}
    for row in rows:
        kept.setdefault(row["robot"], []).append(lasted(row))
    return {robot: float(np.mean(values)) for robot, values in kept.items()}


def median_of(rows: list[dict], name: str) -> float | None:
    values = [row[name] for row in rows if lasted(row) and row[name] is not None]
    return float(np.median(values)) if values else None


def scores(rows: list[dict]) -> list[dict]:
    """Of every robot type, engine, peer and point; `all` are the points together."""
    out = []
    for kind in sorted({row["kind"] for row in rows}):
        for engine in ENGINES:
            here = [row for row in rows if (row["kind"], row["engine"]) == (kind, engine)]
            for peer in dict.fromkeys(row["peer"] for row in here):
                for point in (*POINTS, ALL):

                    def of(name: str, here: list[dict] = here, point: str = point) -> list[dict]:
                        return [r for r in here if r["peer"] == name and point in (r["point"], ALL)]

                    mine = of(peer)
                    if not mine:
                        continue
                    kept = sum(map(lasted, mine))
                    score = {
                        "kind": kind,
                        "engine": engine,
                        "peer": peer,
                        "point": point,
                        "upright": kept,
                        "runs": len(mine),
                        "interval": wilson(kept, len(mine)),
                        "fell_with_motors_on": sum(row["ended"] == "fell" for row in mine),
                        "position_rmse_m": median_of(mine, "position_rmse_m"),
                        "yaw_rate_hz": median_of(mine, "yaw_rate_mean_hz"),
                        "ours_ahead": None,
                    }
                    if peer != OURS and of(OURS):
                        score["ours_ahead"] = difference(by_robot(of(OURS)), by_robot(mine))
                    out.append(score)
    return out


def cell(score: dict) -> str:
    """Share in percent and whose lead is sure."""
    text = f"{100 * score['upright'] / score['runs']:.0f}"
    if score["ours_ahead"] is not None:
        _, low, high = score["ours_ahead"]
        text = f"{text} ▼" if low > 0 else f"**{text} ▲**" if high < 0 else text
    return text


def lost(told: list[dict]) -> list[str]:
    """Where a peer is ahead of ours for sure."""
    return [
        f"- {s['kind']}, {s['engine']}, {s['point']}: {s['peer']} by {-100 * gap:.0f} points "
        f"({-100 * high:.0f} to {-100 * low:.0f})."
        for s in told
        if s["ours_ahead"] is not None
        for gap, low, high in [s["ours_ahead"]]
        if high < 0
    ]


def page(told: list[dict], about: dict) -> str:
    """docs/reports/benchmark.md."""
    names = (*POINTS, ALL)
    robots = about["robots"]
    lines = [
        "# The field's benchmark, measured",
        f"Written by `./tools/benchmark --write` at {about['commit']}, {about['date']}; what it means: "
        "[benchmark.md](../benchmark.md).",
        "",
        f"{robots} robots of each type, {about['first_robot']} to {about['first_robot'] + robots - 1}, world "
        f"`{about['fidelity']}`, one run at each point and in each engine; version {about['version']}. "
        "Upright and armed after 12 s, in percent; ▼: ours is ahead, ▲: the peer is, by the 95 % interval of "
        "the difference.",
        "",
        "![Share upright with 95 % intervals, at each point for each peer](benchmark.png)",
    ]
    for kind in dict.fromkeys(s["kind"] for s in told):
        lines += ["", f"| {kind} | engine | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
        for peer in dict.fromkeys(s["peer"] for s in told if s["kind"] == kind):
            for engine in ENGINES:
                row = {
                    s["point"]: s for s in told if (s["kind"], s["engine"], s["peer"]) == (kind, engine, peer)
                }
                if row:
                    cells = (cell(row[name]) if name in row else "" for name in names)
                    lines.append(f"| {peer} | {engine} | {' | '.join(cells)} |")
    whole = [s for s in told if s["point"] == ALL]
    lines += ["", "| all points | engine | upright | 95 % | fell with motors on | position, median m |"]
    lines += ["|---|---|---|---|---|---|"]
    for s in whole:
        low, high = s["interval"]
        position = "" if s["position_rmse_m"] is None else f"{s['position_rmse_m']:.3f}"
        lines.append(
            f"| {s['kind']} {s['peer']} | {s['engine']} | {s['upright']} of {s['runs']} | {100 * low:.0f} to "
            f"{100 * high:.0f} | {s['fell_with_motors_on']} | {position} |"
        )
    lines += ["", "Where ours is behind:", "", *(lost(told) or ["- nowhere by this interval."])]
    return "\n".join(lines) + "\n"
