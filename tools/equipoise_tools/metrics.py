"""Numbers of a run, from its log alone: errors against the simulation's truth, duties, timing, events."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from equipoise_robot.errors import UserError
from equipoise_robot.log import Log

from . import names

# Errors count from 5 s on, as in `equipoise sim --json`; less half a tick, for time stamps are rounded.
SETTLE_S = 5.0 - 0.0025
FALLEN_RAD = 0.6  # the safety gate's default tilt limit
# The verdict's words and limits are those of src/app/trial/verdict.cpp.
SURELY_FALLING_RAD = 0.9 * FALLEN_RAD
PATIENCE_S = 0.1  # between the request and armed motors


@dataclass
class Errors:
    """Of one estimator, against the truth."""

    attitude_rmse_rad: float
    rolling_rmse_rad_s: float  # of the ball's or the wheels' rate
    speed_rmse_m_s: float | None  # the same in metres, when the log says the radius
    t_s: np.ndarray = field(repr=False)
    attitude_rad: np.ndarray = field(repr=False)  # error's length over the tilt axes
    rolling_rad_s: np.ndarray = field(repr=False)


@dataclass
class Summary:
    robot: str
    duration_s: float
    ticks: int
    armed_s: float
    ended: str  # one of names.ENDED; of a log that was cut off: finished, fell or disarmed
    reasons: list[str]
    fell_at_s: float | None  # when it fell or was disarmed
    yaw_rate_mean_hz: float | None = None
    duty_max: float | None = None
    saturated_fraction: float | None = None
    position_rmse_m: float | None = None
    compute_us: tuple[float, float, float] | None = None  # median, 99th percentile, largest
    overruns: int = 0
    dropped_records: int = 0
    battery_V: tuple[float, float] | None = None  # lowest, mean
    estimators: dict[str, Errors] = field(default_factory=dict)
    events: list[tuple[float, str]] = field(default_factory=list)
    tilt_rms_rad: float | None = None  # of the estimate, while armed
    nis_mean: float | None = None  # while armed; 1 when the noise is as the filter believes
    alarms: list[tuple[float, str, int]] | None = None  # first, what, ticks


def run_record(log: Log):
    return log[names.RUN][0] if names.RUN in log else None


def robot_of(log: Log) -> str:
    run = run_record(log)
    if run is not None:
        return run.robot
    wheels = log[names.MOTORS]["motors"][0] if names.MOTORS in log else 0
    return {2: "mip", 3: "mbbr"}.get(int(wheels), "robot")


def motors_of(log: Log) -> int:
    """What it says, within what it holds."""
    motors = log[names.MOTORS]
    return int(np.clip(motors["motors"][0], 1, motors["duty"].shape[1]))


def tilt_axes(log: Log) -> int:
    """The MBBR tilts about two axes, the MIP about one."""
    return 1 if robot_of(log) == "mip" else 2


def aligned(log: Log, first: str, second: str) -> tuple[np.ndarray, np.ndarray]:
    """The records of two channels that belong to the same ticks: either may have lost some."""
    a, b = log[first], log[second]
    _, i, j = np.intersect1d(a["tick"], b["tick"], return_indices=True)
    return a[i], b[j]


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi


def rolling_rates(records: np.ndarray, axes: int) -> np.ndarray:
    """Of the ball about the inertial axes (telemetry has them in the yaw frame), or of the wheels."""
    if axes == 1:
        return records["phi_dot_rad_s"][:, :1]
    cos, sin = np.cos(records["theta_rad"][:, 2]), np.sin(records["theta_rad"][:, 2])
    x, y = records["phi_dot_rad_s"].T
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def errors_of(log: Log, channel: str) -> Errors:
    estimate, truth = aligned(log, channel, names.TRUTH)
    axes = tilt_axes(log)
    t_s = (estimate["utime"] - log.start_utime) * 1e-6
    tilt = wrapped(estimate["theta_rad"][:, :axes] - truth["theta_rad"][:, :axes])
    rolling = rolling_rates(estimate, axes) - rolling_rates(truth, axes)
    counted = t_s >= SETTLE_S
    run = run_record(log)
    rolling_rmse = rms(rolling[counted])
    return Errors(
        attitude_rmse_rad=rms(tilt[counted]),
        rolling_rmse_rad_s=rolling_rmse,
        speed_rmse_m_s=rolling_rmse * run.rolling_radius_m if run is not None else None,
        t_s=t_s,
        attitude_rad=np.linalg.norm(tilt, axis=1),
        rolling_rad_s=np.linalg.norm(rolling, axis=1),
    )


def estimator_channels(log: Log) -> dict[str, str]:
    """Estimator -> channel, the controlling one first; the truth is not compared with itself."""
    found = {}
    if names.STATE in log:
        run = run_record(log)
        found[run.estimator if run is not None else "estimate"] = names.STATE
    for channel in sorted(log):
        name = names.estimator_of(channel)
        if name is not None and name != "truth":
            found.setdefault(name, channel)
    return found


def safety_events(log: Log) -> list[tuple[float, str]]:
    """When the motors' permission or the reasons against it changed, in words."""
    if names.HEALTH not in log:
        return []
    health = log[names.HEALTH]
    t_s = log.seconds(names.HEALTH)
    key = np.stack([health["arm_state"], health["reasons"], health["sensor_health"]], axis=1)
    changed = np.flatnonzero(np.any(key[1:] != key[:-1], axis=1)) + 1
    events = []
    for i in [0, *changed]:
        words = [names.arm_state(int(health["arm_state"][i]))]
        words += names.bits(int(health["reasons"][i]), names.SAFETY_REASONS)
        words += names.bits(int(health["sensor_health"][i]), names.SENSOR_HEALTH)
        events.append((float(t_s[i]), ", ".join(words)))
    return events


def fault_events(log: Log) -> list[tuple[float, str]]:
    """Verdicts on sensors, as src/app/trial/fault_verdict.cpp says them."""
    if names.FAULTS not in log:
        return []
    faults, t_s = log[names.FAULTS], log.seconds(names.FAULTS)
    events = []
    for i in np.flatnonzero(faults["decided"]):
        f, before = faults[i], int(faults["verdicts"][i - 1]) if i else 0
        now, leading, runner_up = int(f["verdicts"]), int(f["leading"]), int(f["runner_up"])
        found = now & ~before
        who = names.fault(leading)
        if runner_up >= 0 and found >> leading & 1 and found >> runner_up & 1:
            who += f" or {names.fault(runner_up)}"
        said = f"{'verdict taken back' if before & ~now else 'verdict'}: {who}"
        said += f", log-likelihood ratio {f['ratio']:.1f}, bound {f['bound']:.1f}"
        said += f", runner-up {names.fault(runner_up)} {f['runner_up_ratio']:.1f}"
        events.append((float(t_s[i]), said))
    return events


def alarms_of(log: Log) -> list[tuple[float, str, int]] | None:
    """What was excluded, and what spoke against the motors once they had run."""
    if names.HEALTH not in log:
        return None
    health, t_s = log[names.HEALTH], log.seconds(names.HEALTH)
    asked = (health["reasons"] & 1 << names.SAFETY_REASONS.index("not requested")) == 0
    ran = np.logical_or.accumulate(health["arm_state"] == names.ARM_STATES.index("armed"))
    found = []
    for bits, words in (
        (health["degraded"], names.DEGRADED),
        (np.where(asked & ran, health["reasons"], 0), names.SAFETY_REASONS),
    ):
        for i, word in enumerate(words):
            at = np.flatnonzero(bits >> i & 1)
            if at.size:
                found.append((float(t_s[at[0]]), word, int(at.size)))
    return sorted(found)


def true_tilt_at(log: Log, ticks: np.ndarray) -> np.ndarray:
    """NaN where nobody knew it."""
    tilt = np.full(ticks.size, np.nan)
    if names.TRUTH in log:
        truth = log[names.TRUTH]
        _, i, j = np.intersect1d(ticks, truth["tick"], return_indices=True)
        tilt[i] = np.linalg.norm(truth["theta_rad"][j][:, : tilt_axes(log)], axis=1)
    return tilt


def verdict(log: Log) -> tuple[str, list[str], float | None]:
    """How it ended, the reasons against the motors then, and when it fell or was disarmed: as the run judged
    itself; of a log that was cut off, what its ticks say."""
    if names.VERDICT in log:
        last = log[names.VERDICT][-1]
        fell_at_s = float(last["fell_at_s"])
        why = names.bits(int(last["reasons"]) & 0xFFFFFFFF, names.SAFETY_REASONS)
        ended = names.ENDED[last["ended"]] if 0 <= last["ended"] < len(names.ENDED) else "finished"
        return ended, why, None if np.isnan(fell_at_s) else fell_at_s
    if names.HEALTH not in log:
        return "finished", [], None
    health, t_s = log[names.HEALTH], log.seconds(names.HEALTH)
    reasons = health["reasons"]
    asked = (reasons & 1 << names.SAFETY_REASONS.index("not requested")) == 0
    driven = health["arm_state"] == names.ARM_STATES.index("armed")
    tilt = true_tilt_at(log, health["tick"])
    fallen = tilt > FALLEN_RAD
    lost = np.flatnonzero(fallen | (asked & ~driven & np.logical_or.accumulate(driven)))
    if lost.size:
        i = lost[0]
        falling = reasons[i] & 1 << names.SAFETY_REASONS.index("tilt") and not tilt[i] < SURELY_FALLING_RAD
        ended = "fell" if fallen[i] or falling else "disarmed"
    else:
        i = health.size - 1
        unasked = np.flatnonzero(~asked)
        asked_from_s = t_s[min(unasked[-1] + 1, i)] if unasked.size else t_s[0]
        refused = asked[i] and not driven.any() and t_s[i] > asked_from_s + PATIENCE_S
        ended = "disarmed" if refused else "finished"
    why = names.bits(int(reasons[i]), names.SAFETY_REASONS)
    return ended, why, None if ended == "finished" else float(t_s[i])


def outcome(summary: Summary) -> str:
    why = f": {', '.join(summary.reasons)}" if summary.reasons else ""
    if summary.ended == "fell":
        return f"fell at {summary.fell_at_s:.2f} s{why}"
    if summary.ended == "disarmed" and not summary.armed_s:
        return f"never armed{why}"
    if summary.ended == "disarmed":
        return f"motors went off at {summary.fell_at_s:.2f} s{why}"
    if summary.ended in ("interrupted", "device"):
        how = "interrupted" if summary.ended == "interrupted" else "the device failed"
        return f"{how} after {summary.duration_s:.1f} s{why}"
    if not why:
        return "upright to the end"
    return f"disarmed at the end{why}" if summary.armed_s else f"disarmed all the time{why}"


def number_rows(summary: Summary) -> list[tuple[str, str]]:
    """What the page's first table and the terminal say."""
    rows = [
        ("outcome", outcome(summary)),
        ("duration", f"{summary.duration_s:.2f} s, {summary.ticks} ticks, armed {summary.armed_s:.2f} s"),
    ]
    if summary.yaw_rate_mean_hz is not None:
        rows.append(("mean yaw rate", f"{summary.yaw_rate_mean_hz:.3f} Hz"))
    if summary.position_rmse_m is not None:
        rows.append(("position error, RMS", f"{100 * summary.position_rmse_m:.2f} cm"))
    if summary.duty_max is not None:
        rows.append(("largest duty", f"{summary.duty_max:.3f}"))
        rows.append(("ticks with a saturated motor", f"{100 * summary.saturated_fraction:.2f} %"))
    if summary.tilt_rms_rad is not None:
        rows.append(("tilt, RMS while armed", f"{np.degrees(summary.tilt_rms_rad):.3f} deg"))
    if summary.nis_mean is not None:
        rows.append(("normalised innovation, mean while armed", f"{summary.nis_mean:.3f}"))
    if summary.alarms is not None:
        said = "; ".join(f"{what} from {t_s:.2f} s, {ticks} ticks" for t_s, what, ticks in summary.alarms)
        rows.append(("alarms", said or "none"))
    if summary.battery_V is not None:
        rows.append(
            ("battery, lowest and mean", f"{summary.battery_V[0]:.2f} V, {summary.battery_V[1]:.2f} V")
        )
    if summary.compute_us is not None:
        rows.append(
            ("tick, median / 99 % / longest", " / ".join(f"{us:.1f}" for us in summary.compute_us) + " µs")
        )
        rows.append(("overruns, records lost", f"{summary.overruns}, {summary.dropped_records}"))
    return rows


def check_time(log: Log) -> None:
    """Of a log that nobody vouches for."""
    for channel in log:
        if "utime" not in (log[channel].dtype.names or ()):
            continue
        utime = log[channel]["utime"]
        lasts_us = float(utime[-1]) - float(utime[0])
        if np.any(utime[1:] < utime[:-1]) or lasts_us > 1e15 or (utime.size > 1 and lasts_us == 0.0):
            raise UserError(f"{log.path}: {channel}: its time stands still, goes back or lasts for 30 years")


def summarise(log: Log) -> Summary:
    check_time(log)
    best = names.TRUTH if names.TRUTH in log else names.STATE
    ticks = max((log[channel].size for channel in log if channel != names.RUN), default=0)
    if ticks == 0:
        raise UserError(f"{log.path}: holds nothing but what was run")
    ended, reasons, fell_at_s = verdict(log)
    summary = Summary(
        robot=robot_of(log),
        duration_s=log.duration_s,
        ticks=ticks,
        armed_s=0.0,
        ended=ended,
        reasons=reasons,
        fell_at_s=fell_at_s,
    )
    if best in log:
        t_s = log.seconds(best)
        settled = t_s >= SETTLE_S
        if np.count_nonzero(settled) > 1 and t_s[-1] > t_s[settled][0]:
            heading, t_s = np.unwrap(log[best]["theta_rad"][:, 2])[settled], t_s[settled]
            summary.yaw_rate_mean_hz = float((heading[-1] - heading[0]) / (t_s[-1] - t_s[0]) / (2 * np.pi))
    if names.MOTORS in log:
        motors = log[names.MOTORS]
        running = motors["enable"]
        if running.any():
            summary.duty_max = float(np.abs(motors["duty"][running]).max())
            summary.saturated_fraction = float(motors["saturated"][running].mean())
    if names.HEALTH in log:
        health = log[names.HEALTH]
        ticks_armed = np.count_nonzero(health["arm_state"] == names.ARM_STATES.index("armed"))
        summary.armed_s = ticks_armed / health.size * log.duration_s
        summary.battery_V = float(health["battery_V"].min()), float(health["battery_V"].mean())
    if names.TIMING in log:
        timing = log[names.TIMING]
        compute_us = timing["compute_ns"] * 1e-3
        if compute_us.any():  # simulated time does not pass while the tick computes
            summary.compute_us = tuple(float(np.percentile(compute_us, p)) for p in (50, 99, 100))
        summary.overruns = int(timing["overruns"].max())
        summary.dropped_records = int(timing["dropped_records"].max())
    if names.TRUTH in log:
        summary.estimators = {
            name: errors_of(log, channel) for name, channel in estimator_channels(log).items()
        }
        if names.REFERENCE in log:
            truth, reference = aligned(log, names.TRUTH, names.REFERENCE)
            counted = (truth["utime"] - log.start_utime) * 1e-6 >= SETTLE_S
            miss = truth["position_W_m"][counted] - reference["position_W_m"][counted]
            summary.position_rmse_m = rms(np.linalg.norm(miss, axis=1)) if miss.size else None
    summary.events = sorted(safety_events(log) + fault_events(log))
    summary.alarms = alarms_of(log)
    if names.HEALTH in log and names.STATE in log:
        state, health = aligned(log, names.STATE, names.HEALTH)
        armed = health["arm_state"] == names.ARM_STATES.index("armed")
        if armed.any():
            tilt = state["theta_rad"][armed][:, : tilt_axes(log)]
            summary.tilt_rms_rad = rms(np.linalg.norm(tilt, axis=1))
            summary.nis_mean = float(state["normalized_innovation"][armed].mean())
    return summary
