"""The report's plots to zoom into: signals of a run, or of several, as data, and what draws them by uPlot."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from . import names, style
from .figures import drive_phases, heading_rad, rolling_unit, smoothed, velocity_W_m_s
from .metrics import Summary, estimator_channels, motors_of, tilt_axes
from .paths import repository_root

UPLOT = repository_root() / "build/page/node_modules/uplot/dist"
SCRIPT = Path(__file__).with_name("interactive.js")
TICK_S = 0.005
POINTS = 12000  # a minute of every tick; of longer runs the extremes between two points


@dataclass
class Series:
    label: str
    t_s: np.ndarray
    values: np.ndarray
    colour: str
    dash: bool = False


@dataclass
class Plot:
    title: str
    unit: str
    series: list[Series] = field(default_factory=list)


@dataclass
class Run:
    """A log with what is shown of it."""

    name: str
    log: Log
    summary: Summary


def on_grid(grid_s: np.ndarray, t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """float32 at the grid's times; of many samples to a point least and greatest by turns; NaN outside."""
    step_s = grid_s[1] - grid_s[0] if grid_s.size > 1 else TICK_S
    sampled_s = float(np.median(np.diff(t_s))) if t_s.size > 1 else TICK_S
    out = np.full(grid_s.size, np.nan, np.float32)
    if step_s < 1.5 * sampled_s:
        index = np.clip(np.searchsorted(t_s, grid_s - 0.5 * sampled_s), 0, t_s.size - 1)
        inside = np.abs(t_s[index] - grid_s) <= 1.5 * sampled_s
        out[inside] = values[index[inside]]
        return out
    # Two points share the samples of both.
    for i in range(0, grid_s.size - 1, 2):
        a, b = np.searchsorted(t_s, (grid_s[i], grid_s[i] + 2 * step_s))
        chunk = values[a:b]
        chunk = chunk[np.isfinite(chunk)]
        if chunk.size:
            low, high = int(chunk.argmin()), int(chunk.argmax())
            out[i], out[i + 1] = chunk[min(low, high)], chunk[max(low, high)]
    return out


def plots_of(run: Run, compared: bool) -> list[Plot]:
    """Of one run everything; beside others its estimate alone."""
    log, axes = run.log, tilt_axes(run.log)
    estimator, *_ = [*estimator_channels(log), "estimate"]
    traces = [(names.STATE, f"estimate ({estimator})", style.ESTIMATE, False)]
    if not compared:
        traces.insert(0, (names.TRUTH, "truth", "#444444", False))
        traces.append((names.REFERENCE, "reference", style.REFERENCE, True))
    traces = [trace for trace in traces if trace[0] in log]
    plots: list[Plot] = []

    def add(title: str, unit: str, values: Callable[[str], np.ndarray], smooth: bool = False) -> None:
        plot = Plot(title, unit)
        for channel, label, colour, dash in traces:
            t_s, y = log.seconds(channel), values(channel)
            if smooth and channel != names.REFERENCE and t_s.size > 1:
                y = smoothed(y, float(np.median(np.diff(t_s))))
            plot.series.append(Series(label, t_s, y, colour, dash))
        if plot.series:
            plots.append(plot)

    def component(name: str, i: int, scale: float = 1.0) -> Callable[[str], np.ndarray]:
        return lambda channel: scale * log[channel][name][:, i]

    degrees = 180 / np.pi
    if axes == 2:
        add("Tilt about x", "deg", component("theta_rad", 0, degrees))
        add("Tilt about y", "deg", component("theta_rad", 1, degrees))
        add("Ball speed along x, smoothed", "cm/s", lambda c: 100 * velocity_W_m_s(log, c)[:, 0], True)
        add("Ball speed along y, smoothed", "cm/s", lambda c: 100 * velocity_W_m_s(log, c)[:, 1], True)
    else:
        scale, unit = rolling_unit(log)
        add("Lean", "deg", component("theta_rad", 0, degrees))
        add("Wheel speed, smoothed", unit, component("phi_dot_rad_s", 0, scale), True)
    add("Position x", "cm", component("position_W_m", 0, 100))
    add("Position y", "cm", component("position_W_m", 1, 100))
    add("Yaw rate", "Hz", component("omega_B_rad_s", 2, 1 / (2 * np.pi)))
    add("Heading", "turns", lambda channel: heading_rad(log, channel) / (2 * np.pi))
    if names.MOTORS in log:
        motors, t_s = log[names.MOTORS], log.seconds(names.MOTORS)
        count = motors_of(log)
        duty = motors["duty"][:, :count]
        if compared:
            series = [Series("largest of the motors", t_s, np.abs(duty).max(axis=1), style.ESTIMATE)]
        else:
            series = [Series(f"motor {i + 1}", t_s, duty[:, i], style.colour(i)) for i in range(count)]
        plots.append(Plot("Duty", "of full", series))
    if names.FAULTS in log:
        faults, t_s = log[names.FAULTS], log.seconds(names.FAULTS)
        series = [Series("leading", t_s, faults["ratio"], style.ESTIMATE)]
        if not compared:
            series.append(Series("runner-up", t_s, faults["runner_up_ratio"], style.colour(2)))
            series.append(Series("bound", t_s, faults["bound"], style.REFERENCE, True))
        plots.append(Plot("Fault hypotheses, log-likelihood ratio", "nats", series))
    if not compared and run.summary.estimators:
        errors = run.summary.estimators.items()
        plots.append(
            Plot(
                "Attitude error",
                "mrad",
                [
                    Series(name, e.t_s, 1000 * e.attitude_rad, style.colour(i))
                    for i, (name, e) in enumerate(errors)
                ],
            )
        )
    if names.STATE in log:
        nis, t_s = log[names.STATE]["normalized_innovation"], log.seconds(names.STATE)
        plots.append(
            Plot("Normalised innovation (NIS)", "1: as expected", [Series("NIS", t_s, nis, style.ESTIMATE)])
        )
    if names.HEALTH in log:
        t_s = log.seconds(names.HEALTH)
        plots.append(
            Plot("Battery", "V", [Series("battery", t_s, log[names.HEALTH]["battery_V"], style.ESTIMATE)])
        )
    return plots


def together(runs: list[Run]) -> list[Plot]:
    """One run's plots, or for each title those of all runs in one plot."""
    if len(runs) == 1:
        return plots_of(runs[0], compared=False)
    merged: dict[tuple[str, str], Plot] = {}
    for i, run in enumerate(runs):
        for plot in plots_of(run, compared=True):
            into = merged.setdefault((plot.title, plot.unit), Plot(plot.title, plot.unit))
            into.series += [Series(run.name, s.t_s, s.values, style.colour(i)) for s in plot.series]
    return list(merged.values())


def encoded(values: np.ndarray) -> str:
    return base64.b64encode(np.asarray(values, "<f4").tobytes()).decode()


def fragment(runs: list[Run]) -> str:
    """HTML with everything in it; empty when uPlot is not installed (./tools/run installs it)."""
    if not (UPLOT / "uPlot.iife.min.js").is_file():
        return ""
    duration_s = max(run.log.duration_s for run in runs)
    ticks = 1 + round(duration_s / TICK_S)
    grid_s = np.arange(ticks) * TICK_S if ticks <= POINTS else np.linspace(0, duration_s, POINTS)
    data = {
        "t": encoded(grid_s),
        "driving": drive_phases(runs[0].log) if len(runs) == 1 else [],
        "plots": [
            {
                "title": plot.title,
                "unit": plot.unit,
                "series": [
                    {
                        "label": s.label,
                        "colour": s.colour,
                        "dash": s.dash,
                        "values": encoded(on_grid(grid_s, s.t_s, s.values)),
                    }
                    for s in plot.series
                ],
            }
            for plot in together(runs)
        ],
    }
    # "<" would let a name in the data end the script.
    inline = json.dumps(data).replace("<", "\\u003c")
    coarse = (
        f" Every point is the least or greatest of {2000 * (grid_s[1] - grid_s[0]):.0f} ms."
        if ticks > POINTS
        else ""
    )
    return "\n".join(
        [
            f"<style>{(UPLOT / 'uPlot.min.css').read_text()}</style>",
            '<p class="fine">Drag or pinch to zoom, double click or tap shows all; the cursor is common to '
            f"all plots; a name in a legend hides its curve.{coarse}</p>",
            '<div id="plots"></div>',
            f'<script type="application/json" id="data">{inline}</script>',
            f"<script>{(UPLOT / 'uPlot.iife.min.js').read_text()}</script>",
            f"<script>{SCRIPT.read_text()}</script>",
        ]
    )
