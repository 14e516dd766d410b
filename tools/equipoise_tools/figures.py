"""The picture of a run, after [T] Fig. 6.6 and 6.25: time series in two columns, the drive phase shaded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from equipoise_robot.log import Log

from . import names, style
from .metrics import Summary, estimator_channels, motors_of, outcome, run_record, tilt_axes
from .style import plt

SMOOTHING_RAD_S = (
    10.0  # [T] section 6.4.5: ball speeds are shown through a zero-phase low-pass of this corner
)
Panel = Callable[[plt.Axes], None]


def smoothed(values: np.ndarray, step_s: float) -> np.ndarray:
    """First-order low-pass, run forwards and backwards, the mean of the two ([T] section 6.4.5)."""
    # By the bilinear transform. SciPy's filters would double the time that a report takes to start.
    corner = np.tan(0.5 * SMOOTHING_RAD_S * step_s)
    pole, share = float((1 - corner) / (1 + corner)), corner / (1 + corner)

    def one_way(x: np.ndarray) -> np.ndarray:
        pairs = (share * (x[1:] + x[:-1])).tolist()
        return np.array([*accumulate(pairs, lambda y, pair: pole * y + pair, initial=float(x[0]))])

    return 0.5 * (one_way(values) + one_way(values[::-1])[::-1])


def velocity_W_m_s(log: Log, channel: str) -> np.ndarray:
    """Of the floor contact: the slope of the inertial position."""
    position = log[channel]["position_W_m"]
    t_s = log.seconds(channel)
    return np.gradient(position, t_s, axis=0) if t_s.size > 1 else np.zeros_like(position)


def heading_rad(log: Log, channel: str) -> np.ndarray:
    return np.unwrap(log[channel]["theta_rad"][:, 2])


def rolling_unit(log: Log) -> tuple[float, str]:
    """What turns a rolling rate in rad/s into the unit shown: cm/s when the log says the radius."""
    run = run_record(log)
    return (1.0, "rad/s") if run is None else (100 * run.rolling_radius_m, "cm/s")


def spans(mask: np.ndarray, t_s: np.ndarray) -> list[tuple[float, float]]:
    """Where the mask holds, as (from, to)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(float(t_s[a]), float(t_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def drive_phases(log: Log) -> list[tuple[float, float]]:
    if names.COMMAND not in log:
        return []
    wanted = np.linalg.norm(log[names.COMMAND]["velocity_W_m_s"], axis=1) > 0
    return spans(wanted, log.seconds(names.COMMAND))


def error_range(curves: list[np.ndarray]) -> tuple[float, float]:
    """Of a logarithmic axis: without the dips through zero, with room for the legend."""
    values = np.concatenate(curves)
    values = values[values > 0]
    return (float(np.percentile(values, 1)) / 2, 20 * float(values.max())) if values.size else (0.1, 1.0)


def legend_beside_title(axes: plt.Axes, columns: int) -> None:
    """Above the panel, where no curve is under it."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=columns, borderaxespad=0.0, columnspacing=1.0
    )


@dataclass(frozen=True)
class Trace:
    """How a channel is drawn in every panel."""

    channel: str
    label: str
    colour: str
    dash: object = "-"
    width: float = 1.1
    over: float = 2.0


class Report:
    """The panels of one log."""

    def __init__(self, log: Log, summary: Summary) -> None:
        self.log = log
        self.summary = summary
        self.axes_count = tilt_axes(log)
        estimator, *_ = [*estimator_channels(log), "estimate"]
        candidates = (
            Trace(names.TRUTH, "truth", style.TRUTH, width=0.9, over=3),
            Trace(names.STATE, f"estimate ({estimator})", style.ESTIMATE, width=1.5),
            Trace(names.REFERENCE, "reference", style.REFERENCE, dash=(0, (4, 2)), over=4),
        )
        self.traces = [trace for trace in candidates if trace.channel in log]
        self.phases = drive_phases(log)

    def lines(self, axes: plt.Axes, values: Callable[[str], np.ndarray], smooth: bool = False) -> None:
        for trace in self.traces:
            t_s = self.log.seconds(trace.channel)
            y = values(trace.channel)
            if smooth and trace.channel != names.REFERENCE and t_s.size > 1:
                axes.plot(t_s, y, color=trace.colour, lw=0.4, alpha=0.25, zorder=1)
                y = smoothed(y, float(np.median(np.diff(t_s))))
            axes.plot(
                t_s,
                y,
                color=trace.colour,
                ls=trace.dash,
                lw=trace.width,
                zorder=trace.over,
                label=trace.label,
            )

    def finish_time_axis(self, axes: plt.Axes) -> None:
        for start, end in self.phases:
            axes.axvspan(start, end, color=style.DRIVE_PHASE, alpha=0.07, lw=0, zorder=0)
        axes.set_xlim(0, max(self.summary.duration_s, 1e-3))
        axes.set_xlabel("time (s)")

    def tilt(self, axis: int, title: str) -> Panel:
        def draw(axes: plt.Axes) -> None:
            self.lines(axes, lambda channel: np.degrees(self.log[channel]["theta_rad"][:, axis]))
            axes.set(title=title, ylabel="deg")
            self.finish_time_axis(axes)

        return draw

    def speed(self, axis: int, title: str) -> Panel:
        def draw(axes: plt.Axes) -> None:
            self.lines(axes, lambda channel: 100 * velocity_W_m_s(self.log, channel)[:, axis], smooth=True)
            axes.set(title=title, ylabel="cm/s")
            self.finish_time_axis(axes)

        return draw

    def wheel_speed(self, axes: plt.Axes) -> None:
        scale, unit = rolling_unit(self.log)
        self.lines(axes, lambda channel: scale * self.log[channel]["phi_dot_rad_s"][:, 0], smooth=True)
        axes.set(title="Wheel speed", ylabel=unit)
        self.finish_time_axis(axes)

    def position(self, axis: int, title: str) -> Panel:
        def draw(axes: plt.Axes) -> None:
            self.lines(axes, lambda channel: 100 * self.log[channel]["position_W_m"][:, axis])
            axes.set(title=title, ylabel="cm")
            self.finish_time_axis(axes)

        return draw

    def yaw_rate(self, axes: plt.Axes) -> None:
        self.lines(axes, lambda channel: self.log[channel]["omega_B_rad_s"][:, 2] / (2 * np.pi))
        axes.set(title="Yaw rate", ylabel="Hz")
        self.finish_time_axis(axes)

    def heading(self, axes: plt.Axes) -> None:
        """Where it should turn with the reference, its departure from it shows what matters."""
        if names.REFERENCE in self.log:
            wanted = heading_rad(self.log, names.REFERENCE)
            t_s = self.log.seconds(names.REFERENCE)
            self.lines(
                axes,
                lambda channel: np.degrees(
                    heading_rad(self.log, channel) - np.interp(self.log.seconds(channel), t_s, wanted)
                ),
            )
            axes.set(title="Heading, departure from the reference", ylabel="deg")
        else:
            self.lines(axes, lambda channel: heading_rad(self.log, channel) / (2 * np.pi))
            axes.set(title="Heading", ylabel="turns")
        self.finish_time_axis(axes)

    def track(self, axes: plt.Axes) -> None:
        for trace in self.traces:
            x, y = 100 * self.log[trace.channel]["position_W_m"].T
            axes.plot(
                x, y, color=trace.colour, ls=trace.dash, lw=trace.width, zorder=trace.over, label=trace.label
            )
        first = 100 * self.log[self.traces[0].channel]["position_W_m"][0]
        axes.plot(*first, "o", color=style.TRUTH, ms=4, zorder=5)
        axes.annotate("start", first, xytext=(5, 5), textcoords="offset points", fontsize=8)
        axes.set(title="Track on the floor", xlabel="x (cm)", ylabel="y (cm)")
        axes.axis("equal")

    def duties(self, axes: plt.Axes) -> None:
        motors = self.log[names.MOTORS]
        count = motors_of(self.log)
        for motor in range(count):
            y = motors["duty"][:, motor]
            axes.plot(
                self.log.seconds(names.MOTORS),
                y,
                color=style.colour(motor),
                lw=0.7,
                alpha=0.85,
                label=f"motor {motor + 1}",
            )
        axes.set(title="Duty", ylabel="of full", ylim=(-1.05, 1.05))
        legend_beside_title(axes, count)
        self.finish_time_axis(axes)

    def evidence(self, axes: plt.Axes) -> None:
        faults, t_s = self.log[names.FAULTS], self.log.seconds(names.FAULTS)
        for field, label, colour in (
            ("runner_up_ratio", "runner-up", style.colour(2)),
            ("ratio", "leading", style.ESTIMATE),
            ("bound", "bound", style.REFERENCE),
        ):
            axes.plot(t_s, faults[field], color=colour, lw=0.8, label=label)
        axes.set(title="Fault hypotheses", ylabel="nats", ylim=(-5, 1.6 * float(faults["bound"].max())))
        legend_beside_title(axes, 3)
        self.finish_time_axis(axes)

    def errors(self, what: str, title: str, unit: str, scale: float) -> Panel:
        def draw(axes: plt.Axes) -> None:
            for index, (name, errors) in enumerate(self.summary.estimators.items()):
                y = scale * getattr(errors, what)
                if y.size > 1:
                    y = smoothed(y, float(np.median(np.diff(errors.t_s))))
                axes.plot(
                    errors.t_s,
                    y,
                    color=style.colour(index),
                    ls=style.dash(index),
                    label=name,
                    zorder=9 - 0.1 * index,
                )
            axes.set(title=title, ylabel=unit)
            if len(self.summary.estimators) > 1:  # they differ by orders of magnitude
                axes.set_yscale("log")
                axes.set_ylim(*error_range([line.get_ydata() for line in axes.lines]))
                box = {"frameon": True, "facecolor": "white", "edgecolor": "none", "framealpha": 0.8}
                axes.legend(loc="upper right", ncols=2, **box)
            else:  # the figure's legend names it
                axes.set_ylim(bottom=0)
            self.finish_time_axis(axes)

        return draw

    def panels(self) -> list[Panel]:
        """In reading order, two per row."""
        log = self.log
        panels: list[Panel] = []
        if self.traces:
            if self.axes_count == 2:
                panels += [
                    self.tilt(0, "Tilt about x, $\\theta_x$"),
                    self.tilt(1, "Tilt about y, $\\theta_y$"),
                ]
                panels += [self.speed(0, "Ball speed along x"), self.speed(1, "Ball speed along y")]
                panels += [self.position(0, "Ball position x"), self.position(1, "Ball position y")]
            else:
                panels += [self.tilt(0, "Tilt, $\\theta$"), self.wheel_speed]
                panels += [self.position(0, "Position x"), self.position(1, "Position y")]
            panels += [self.yaw_rate, self.heading]
            panels += [self.track]
        if names.MOTORS in log:
            panels += [self.duties]
        if names.FAULTS in log:
            panels += [self.evidence]
        if self.summary.estimators:
            panels += [self.errors("attitude_rad", "Attitude error, smoothed", "mrad", 1000)]
            rolling = "Ball" if self.axes_count == 2 else "Wheel"
            scale, unit = rolling_unit(log)
            panels += [self.errors("rolling_rad_s", f"{rolling} speed error, smoothed", unit, scale)]
        return panels


def headline(log: Log, summary: Summary) -> str:
    run = run_record(log)
    words = [summary.robot.upper()]
    if run is not None:
        words += [f"{run.estimator} + {run.controller}"]
        words += [f"{run.fidelity} world, seed {run.seed}"] if run.fidelity else []
    if summary.yaw_rate_mean_hz is not None:
        words.append(f"spinning at {summary.yaw_rate_mean_hz:.2f} Hz")
    if names.COMMAND in log:
        words.append(
            f"driving at {100 * np.linalg.norm(log[names.COMMAND]['velocity_W_m_s'], axis=1).max():.0f} cm/s"
        )
    return "  ·  ".join(words)


def draw_report(log: Log, summary: Summary) -> plt.Figure:
    with style.styled():
        report = Report(log, summary)
        panels = report.panels()
        rows = (len(panels) + 1) // 2
        figure, grid = plt.subplots(
            rows, 2, figsize=(12.0, 0.9 + 2.05 * rows), squeeze=False, layout="constrained"
        )
        for axes, draw in zip(grid.flat, panels, strict=False):
            draw(axes)
        for axes in grid.flat[len(panels) :]:
            axes.remove()
        figure.suptitle(f"{headline(log, summary)}  ·  {outcome(summary)}", fontsize=12, fontweight="bold")
        if report.traces:
            handles, labels = grid.flat[0].get_legend_handles_labels()
            handles += (
                [plt.Rectangle((0, 0), 1, 1, color=style.DRIVE_PHASE, alpha=0.12, lw=0)]
                if report.phases
                else []
            )
            labels += ["driving"] if report.phases else []
            figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9)
        return figure
