"""python -m equipoise_tools.view [--url URL] [--once]: the robot's telemetry, live in a terminal."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from equipoise_robot.lcm_types import message_types

import lcm

from . import names
from .entry import leave
from .paths import UserError

DEFAULT_URL = "udpm://239.255.76.67:7667?ttl=0"  # LCM's own, kept on this host
BAR_WIDTH = 20
TILT_FULL_SCALE_DEG = 15.0


@dataclass
class Latest:
    """The newest message of each channel, and how many came."""

    messages: dict[str, object] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    unknown: int = 0

    def take(self, channel: str, data: bytes) -> None:
        kind = message_types().get(bytes(data[:8]))
        try:
            message = kind.decode(data) if kind is not None else None
        except Exception:  # generated decoders raise whatever struct does on a short message
            message = None
        if message is None:
            self.unknown += 1
            return
        self.messages[channel] = message
        self.counts[channel] = self.counts.get(channel, 0) + 1


def bar(value: float, full_scale: float) -> str:
    """-full_scale .. full_scale around a middle mark; not finite: question marks."""
    if not math.isfinite(value):
        return "?" * (2 * BAR_WIDTH + 1)
    cells = round(min(1.0, abs(value) / full_scale) * BAR_WIDTH)
    filled = "█" * cells
    left, right = (
        (filled.rjust(BAR_WIDTH), " " * BAR_WIDTH)
        if value < 0
        else (" " * BAR_WIDTH, filled.ljust(BAR_WIDTH))
    )
    return f"{left}│{right}"


def _state_words(latest: Latest) -> list[str]:
    health = latest.messages.get(names.HEALTH)
    if health is None:
        return []
    words = [names.arm_state(health.arm_state), *names.bits(health.reasons, names.SAFETY_REASONS)]
    return words + names.bits(health.sensor_health, names.SENSOR_HEALTH)


def one_line(latest: Latest) -> str:
    """A line for a log or a pipe."""
    state = latest.messages.get(names.STATE)
    motors = latest.messages.get(names.MOTORS)
    health = latest.messages.get(names.HEALTH)
    words = []
    if state is not None:
        tilt = ", ".join(f"{math.degrees(angle):+.2f}" for angle in state.theta_rad[:2])
        x, y = (100 * p for p in state.position_W_m)
        words += [f"t {state.utime * 1e-6:.2f} s", f"tilt {tilt} deg"]
        words += [f"yaw {state.omega_B_rad_s[2] / (2 * math.pi):+.2f} Hz", f"at {x:+.1f}, {y:+.1f} cm"]
    if motors is not None:
        words.append("duty " + ", ".join(f"{duty:+.2f}" for duty in motors.duty[: max(motors.motors, 1)]))
    if health is not None:
        words += [f"{health.battery_V:.2f} V", "/".join(_state_words(latest))]
    return "  ".join(words) if words else f"nothing known yet ({latest.unknown} unknown messages)"


def panel(latest: Latest, rates_hz: dict[str, float], url: str) -> list[str]:
    """The screen."""
    lines = [f"Equipoise telemetry on {url}   (Ctrl-C leaves)", ""]
    state = latest.messages.get(names.STATE)
    if state is not None:
        for label, angle in zip(("tilt x", "tilt y"), state.theta_rad[:2], strict=True):
            degrees = math.degrees(angle)
            lines.append(f"{label:<9}{bar(degrees, TILT_FULL_SCALE_DEG)} {degrees:+7.2f} deg")
        lines.append(f"{'yaw':<9}{state.omega_B_rad_s[2] / (2 * math.pi):+.3f} Hz")
        lines.append(f"{'at':<9}{100 * state.position_W_m[0]:+.1f}, {100 * state.position_W_m[1]:+.1f} cm")
        lines.append(f"{'NIS/dof':<9}{state.normalized_innovation:.2f}")
    motors = latest.messages.get(names.MOTORS)
    if motors is not None:
        for i, duty in enumerate(motors.duty[: max(motors.motors, 1)]):
            lines.append(
                f"{f'motor {i + 1}':<9}{bar(duty, 1.0)} {duty:+7.3f}{'' if motors.enable else '  off'}"
            )
    health = latest.messages.get(names.HEALTH)
    if health is not None:
        lines.append(f"{'battery':<9}{health.battery_V:.2f} V")
        lines.append(f"{'motors':<9}{', '.join(_state_words(latest))}")
    timing = latest.messages.get(names.TIMING)
    if timing is not None:
        lost = f"{timing.overruns} overruns, {timing.dropped_records} records lost"
        lines.append(f"{'tick':<9}{timing.compute_ns * 1e-3:.1f} µs, {lost}")
    lines.append("")
    lines += [f"{channel:<32}{rate:7.1f} Hz" for channel, rate in sorted(rates_hz.items())]
    if latest.unknown:
        lines.append(f"{latest.unknown} messages of an unknown type or version")
    return lines


def updates(source: lcm.LCM, latest: Latest, every_s: float, for_s: float) -> Iterator[dict[str, float]]:
    """Takes messages in; yields each channel's rate once per interval until the time is over."""
    started = last = time.monotonic()
    before: dict[str, int] = {}
    while last - started < for_s:
        due = min(last + every_s, started + for_s)
        while (left_s := due - time.monotonic()) > 0:
            source.handle_timeout(max(1, int(1000 * left_s)))
        now = time.monotonic()
        yield {
            channel: (count - before.get(channel, 0)) / (now - last)
            for channel, count in latest.counts.items()
        }
        before = dict(latest.counts)
        last = now


def open_source(url: str) -> lcm.LCM:
    if url.startswith("file:") and "mode=r" not in url:
        raise UserError(f"{url}: LCM might replace that file; add ?mode=r to play it")
    if url.startswith("tcpq:"):
        raise UserError(f"{url}: LCM ends the program when its server does; use udpm")
    try:
        return lcm.LCM(url)
    except (RuntimeError, OSError):
        raise UserError(
            f"cannot open {url}; LCM needs a multicast route, for example: ip route add 224.0.0.0/4 dev lo"
        ) from None


def view(source: lcm.LCM, url: str, once: bool, seconds: float) -> int:
    latest = Latest()
    source.subscribe("EQUIPOISE_.*", latest.take)
    for rates_hz in updates(source, latest, 1.0 if once else 0.2, seconds):
        if once:
            print(one_line(latest), flush=True)
        else:
            print("\x1b[H\x1b[2J" + "\n".join(panel(latest, rates_hz, url)), flush=True)
    if not latest.messages:
        print(
            f"error: no Equipoise telemetry on {url}; is equipoise running with --telemetry?",
            file=sys.stderr,
        )
        return 1
    return 0


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.view",
        description="Shows the robot's LCM telemetry live in a terminal.",
    )
    parser.add_argument("--url", default=DEFAULT_URL, help="LCM URL (default: %(default)s)")
    parser.add_argument("--once", action="store_true", help="no screen: print one line per second")
    parser.add_argument(
        "--seconds", type=float, default=math.inf, help="leave after this time (default: never)"
    )
    options = parser.parse_args(arguments)
    try:
        return view(open_source(options.url), options.url, options.once, options.seconds)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    leave(main)
