"""Tables and figure of docs/reports/estimators.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .. import style
from ..paths import UserError
from ..style import plt
from .filters import FILTERS
from .judge import median_interval, spread
from .measure import Row
from .model import GROUPS

BEGIN, END = "<!-- measured: python -m equipoise_tools.estimator_comparison -->", "<!-- /measured -->"
NAMES = [kind.name for kind in FILTERS]
QUANTITIES = (
    ("attitude_rmse_rad", "attitude, mrad", 1e3),
    ("speed_rmse_m_s", "speed, cm/s", 1e2),
    ("heading_error_rad", "heading at the end, rad", 1.0),
)


def column(rows: list[Row], name: str, filter_: str, **where) -> np.ndarray:
    """By robot, so that the filters' columns are pairs."""
    chosen = [r for r in rows if r["filter"] == filter_ and all(r[k] == v for k, v in where.items())]
    return np.array([float(r[name]) for r in sorted(chosen, key=lambda r: float(r["robot_number"]))])


def cases(rows: list[Row], world: str = "full") -> list[dict]:
    found = {(r["yaw_hz"], r["drive_mps"]) for r in rows if r["world"] == world}
    return [{"world": world, "yaw_hz": y, "drive_mps": d} for y, d in sorted(found)]


def _table(head: list[str], body: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *body]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _value(name: str, values: np.ndarray) -> np.ndarray:
    return np.abs(values) if name == "heading_error_rad" else values


def errors_table(rows: list[Row]) -> str:
    body = []
    for case in cases(rows):
        for filter_ in NAMES:
            cells = [f"{case['yaw_hz']:g} Hz, {100 * case['drive_mps']:.0f} cm/s", filter_]
            for name, _, scale in QUANTITIES:
                middle, low, high = spread(scale * _value(name, column(rows, name, filter_, **case)))
                cells.append(f"{middle:.3g} ({low:.3g} to {high:.3g})")
            body.append(cells)
    return _table(["yaw, drive", "filter", *(label for _, label, _ in QUANTITIES)], body)


def differences_table(rows: list[Row]) -> str:
    body = []
    for case in cases(rows):
        for filter_ in NAMES[1:]:
            cells = [f"{case['yaw_hz']:g} Hz", filter_]
            for name, _, scale in QUANTITIES:
                ours = _value(name, column(rows, name, NAMES[0], **case))
                differs = scale * (_value(name, column(rows, name, filter_, **case)) - ours)
                middle, low, high = median_interval(differs)
                share = 100 * np.median(differs / (scale * ours))
                cells.append(f"{middle:+.2g} [{low:+.2g}, {high:+.2g}], {share:+.1f} %")
            body.append(cells)
    return _table(["yaw", "filter less extended", *(label for _, label, _ in QUANTITIES)], body)


def consistency_table(rows: list[Row]) -> str:
    body = []
    for world in ("drawn", "full"):
        for case in cases(rows, world):
            for filter_ in NAMES[:3]:
                cells = [f"{world}, {case['yaw_hz']:g} Hz", filter_]
                for group in GROUPS:
                    nis, low, high = spread(column(rows, f"nis_{group}", filter_, **case))
                    lag = np.median(column(rows, f"lag1_{group}", filter_, **case))
                    out = 100 * np.median(column(rows, f"coloured_{group}", filter_, **case))
                    cells.append(f"{nis:.2g} ({low:.2g} to {high:.2g}); {lag:+.2f}; {out:.0f} %")
                body.append(cells)
    return _table(["samples", "filter", *GROUPS], body)


def _one(rows: list[Row], name: str, filter_: str) -> float:
    return float(column(rows, name, filter_, world="full")[0])


def cost_table(rows: list[Row]) -> str:
    body = []
    for filter_ in NAMES:
        cells = [filter_]
        for name in ("single_us_per_tick", "batch_us_per_tick"):
            us = _one(rows, name, filter_)
            cells.append(f"{us:.0f}, {us / _one(rows, name, NAMES[0]):.1f}")
        wrong = spread(1e3 * column(rows, "wrong_start_rmse_rad", filter_, world="full"))
        cells.append("{:.1f} ({:.1f} to {:.1f})".format(*wrong))
        apart = (
            column(rows, f"from_firmware_{unit}", filter_, world="full").max() for unit in ("rad", "m_s")
        )
        cells.append("{:.0e} rad, {:.0e} m/s".format(*apart))
        body.append(cells)
    runs = column(rows, "yaw_hz", NAMES[0], world="full").size
    head = ["filter", "µs per tick, one run; ratio", f"{runs} at once; ratio", "wrong start, mrad"]
    return _table([*head, "largest distance from the firmware"], body)


def tables(rows: list[Row]) -> str:
    parts = (
        ("Errors: median (5 to 95 % of the robots).", errors_table(rows)),
        ("The same robot's difference: median [95 % interval], and as a share.", differences_table(rows)),
        (
            "NIS per degree of freedom, median (5 to 95 %); correlation of successive innovations; share of "
            "the lags 1 to 20 outside the 95 % band of white noise, 5 % expected.",
            consistency_table(rows),
        ),
        (
            "Cost in NumPy; the tilt's error, RMS, in the first 3 s after a start that is 0.1 rad wrong.",
            cost_table(rows),
        ),
    )
    return "\n\n".join(f"{about}\n\n{table}" for about, table in parts)


def insert(path: Path, text: str, measured: str | None = None) -> None:
    """`measured`: commit and date; without, those that the page has."""
    if not path.exists():
        return
    page = path.read_text()
    if BEGIN not in page or END not in page:
        raise UserError(f"{path}: has no '{BEGIN}' ... '{END}' for the tables")
    before, rest = page.split(BEGIN, 1)
    if measured:
        before = re.sub(r"Measured at \S+, [\d-]+\.", f"Measured at {measured}.", before)
    path.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END, 1)[1]}")


def _range(axes: plt.Axes, at: float, values: np.ndarray, index: int, label: str | None) -> None:
    middle, low, high = spread(values)
    markers = "os^D"
    axes.plot([at, at], [low, high], color=style.colour(index), lw=1.6)
    axes.plot(at, middle, markers[index], color=style.colour(index), ms=4.5, label=label)


def draw(rows: list[Row], out_dir: Path) -> None:
    out_dir.mkdir(parents=True, exist_ok=True)
    with style.styled():
        figure, grid = plt.subplots(2, 2, figsize=(9.5, 5.8), layout="constrained")
        titles = ("Attitude error, RMS", "Ball speed error in the yaw frame, RMS", "Heading error at the end")
        units = ("mrad", "cm/s", "rad")
        shown = cases(rows)
        for axes, (name, _, scale), title, unit in zip(grid.flat, QUANTITIES, titles, units, strict=False):
            for at, case in enumerate(shown):
                for i, filter_ in enumerate(NAMES):
                    values = scale * _value(name, column(rows, name, filter_, **case))
                    _range(axes, at + 0.17 * (i - 1.5), values, i, filter_ if at == 0 else None)
            axes.set(title=title, ylabel=unit, xticks=range(len(shown)))
            axes.set_xticklabels([f"{c['yaw_hz']:g} Hz\n{100 * c['drive_mps']:.0f} cm/s" for c in shown])
            if name == "heading_error_rad":
                axes.set_yscale("log")
            else:
                axes.set_ylim(bottom=0)
        axes = grid[1, 1]
        shown = [*cases(rows, "drawn")[:1], cases(rows)[0], cases(rows)[-1]]
        ticks = []
        for g, group in enumerate(GROUPS):
            for j, case in enumerate(shown):
                at = 3.6 * g + j
                of = "drawn" if case["world"] == "drawn" else f"{case['yaw_hz']:g} Hz"
                ticks.append((at, f"{of}\n{group}" if j == 1 else of))
                for i, filter_ in enumerate(NAMES):
                    values = column(rows, f"nis_{group}", filter_, **case)
                    _range(axes, at + 0.17 * (i - 1.5), values, i, None)
        axes.axhline(1.0, color=style.TRUTH, lw=0.9)
        axes.set(title="NIS per degree of freedom", yscale="log", xticks=[at for at, _ in ticks])
        axes.set_xticklabels([text for _, text in ticks])
        style.legend_above(figure, grid[0, 0], columns=len(NAMES))
        style.save(figure, out_dir / "estimators")
