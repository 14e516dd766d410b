"""Time plots in the layout of [T] chapter 6: attitude, ball speed and position over time, one column an "
"axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import figures, names, style
from ..metrics import rolling_rates, run_record
from ..style import plt
from .data import TRACE_HZ, Data

# What a trace holds of each filter; the suffix of a series.


def series_of(log: Log, channels: dict[str, str], position: bool = True) -> dict:
    """{"LABEL theta_x": (t_s, rad), ...}; ball speeds in cm/s, inertial, smoothed without phase as [T] "
    "6.4.5."""
    radius_m = run_record(log).rolling_radius_m
    found = {}
    for label, channel in channels.items():
        if channel not in log:
            continue
        t_s, records = log.seconds(channel), log[channel]
        rates = rolling_rates(records, 2)
        columns = {
            "theta_x": records["theta_rad"][:, 0],
            "theta_y": records["theta_rad"][:, 1],
            "speed_x": 100 * radius_m * figures.smoothed(rates[:, 1], 0.005),
            "speed_y": -100 * radius_m * figures.smoothed(rates[:, 0], 0.005),
        }
        if position:
            columns["x"], columns["y"] = records["position_W_m"].T
            columns["heading"] = np.unwrap(records["theta_rad"][:, 2])
            columns["turn"] = figures.smoothed(records["omega_B_rad_s"][:, 2], 0.005)
        found |= {f"{label} {name}": (t_s, values) for name, values in columns.items()}
    return found


COLOURS = {"truth": style.TRUTH, "reference": style.REFERENCE}
UNITS = {"theta": "rad", "speed": "cm/s", "heading": "rad", "turn": "rad/s"}


def draw(
    path: Path, data: Data, case: str, labels: tuple[str, ...], title: str, first_s: float = 0.0
) -> None:
    """Rows attitude, ball speed and, where recorded, position; then the attitude's error."""
    rows = [("theta_x", "theta_y"), ("speed_x", "speed_y")]
    if any(series.endswith((" x", " y")) for named, series in data.traces if named == case):
        rows += [("x", "y"), ("heading", "turn")]
    estimates = [label for label in labels if label not in COLOURS]
    with plt.rc_context(style.RC):
        figure, panels = plt.subplots(
            len(rows) + 1, 2, figsize=(9, 1.7 * len(rows) + 2), sharex=True, layout="constrained"
        )
        for row, quantities in zip(panels[:-1], rows, strict=True):
            for axes, quantity in zip(row, quantities, strict=True):
                for label in labels:
                    series = f"{label} {quantity}"
                    if (case, series) not in data.traces:
                        continue
                    values = data.trace(case, series)
                    at = estimates.index(label) if label in estimates else 0
                    axes.plot(
                        first_s + np.arange(values.size) / TRACE_HZ,
                        values,
                        color=COLOURS.get(label, style.colour(at)),
                        ls=(0, (4, 2)) if label == "reference" else "-",
                        lw=1.0,
                        zorder=4 if label == "truth" else 3,
                        label=label,
                    )
                unit = UNITS.get(quantity.partition("_")[0], "m")
                axes.set(ylabel=f"{quantity.replace('_', ' ')}, {unit}")
        for axes, quantity in zip(panels[-1], ("theta_x", "theta_y"), strict=True):
            truth = data.trace(case, f"truth {quantity}")
            for i, label in enumerate(estimates):
                if (case, f"{label} {quantity}") in data.traces:
                    error = data.trace(case, f"{label} {quantity}") - truth
                    axes.plot(
                        first_s + np.arange(error.size) / TRACE_HZ, error, color=style.colour(i), lw=1.0
                    )
            axes.set(ylabel=f"error of {quantity.replace('_', ' ')}, rad", xlabel="time, s")
        panels[0, 0].set_title(title, fontsize=8)
        style.legend_above(figure, panels[0, 0])
        style.save(figure, path)


def channels(own: str, *others: str) -> dict[str, str]:
    """Labels to channels: truth, reference, the controlling filter and those beside it."""
    found = {"truth": names.TRUTH, "reference": names.REFERENCE, own: names.STATE}
    return found | {other: f"{names.STATE}_{other.upper()}" for other in others}
