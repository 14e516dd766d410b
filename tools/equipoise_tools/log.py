"""Reads an LCM event log into NumPy arrays, also when its end is missing or a piece of it is damaged."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from . import names
from .lcm_types import decode_messages
from .paths import UserError

# One event: sync word, number, time in microseconds, lengths of channel and data; then both. Big-endian.
_HEADER = struct.Struct(">IqqII")
_SYNC = struct.pack(">I", 0xEDA1DA01)
_LONGEST_CHANNEL = 256
_LARGEST_MESSAGE = 1 << 24


class Log(dict):
    """Channel -> record array (an entry per message, a field per LCM field); `notes`: what was wrong."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.notes: list[str] = []
        self.start_utime = 0

    def seconds(self, channel: str) -> np.ndarray:
        """Time of each message since the start."""
        return (self[channel]["utime"] - self.start_utime) * 1e-6

    @property
    def duration_s(self) -> float:
        return max(
            self.seconds(channel)[-1] for channel in self if "utime" in (self[channel].dtype.names or ())
        )


def scan(data: bytes) -> tuple[list[tuple[int, str, bytes]], list[str]]:
    """(utime, channel, message) of every intact event, and notes on what is not."""
    events = []
    notes = []
    at = 0
    while at < len(data):
        intact = False
        if data[at : at + 4] == _SYNC and at + _HEADER.size <= len(data):
            _, _, utime, channel_bytes, message_bytes = _HEADER.unpack_from(data, at)
            if channel_bytes <= _LONGEST_CHANNEL and message_bytes <= _LARGEST_MESSAGE:
                body = at + _HEADER.size
                end = body + channel_bytes + message_bytes
                if end <= len(data):
                    channel = data[body : body + channel_bytes].decode(errors="replace")
                    events.append((utime, channel, data[body + channel_bytes : end]))
                    at = end
                    intact = True
        if not intact:
            following = data.find(_SYNC, at + 1)
            if following < 0:
                notes.append(f"cut off after {at} of {len(data)} bytes; what precedes is used")
                break
            notes.append(f"{following - at} bytes at {at} are damaged and left out")
            at = following
    return events, notes


def read_log(path: str | Path) -> Log:
    """The log's channels. Raises UserError when the file is not a log or nothing of it is ours."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    log = Log(path)
    events, log.notes = scan(data)
    if not events:
        raise UserError(f"{path}: is not an LCM event log, or holds no whole event")
    by_kind: dict[tuple[str, bytes], list[bytes]] = defaultdict(list)
    for _, channel, message in events:
        by_kind[channel, message[:8]].append(message)
    unknown: Counter[str] = Counter()
    for (channel, _), messages in by_kind.items():
        try:
            records = decode_messages(messages)
        except ValueError as error:
            log.notes.append(f"channel {channel} is left out: {error}")
            continue
        if records is None:
            unknown[channel] += len(messages)
        elif channel in log:
            log.notes.append(f"channel {channel} changes its type; only the first is used")
        else:
            log[channel] = records
    for channel, count in unknown.items():
        log.notes.append(f"channel {channel}: {count} messages of an unknown type or version are left out")
    if not log:
        raise UserError(f"{path}: holds no message of a type this version knows ({'; '.join(log.notes)})")
    # Simulated clocks start at 0. A robot's starts at its boot, its log with the first sample.
    if names.TRUTH not in log:
        log.start_utime = min((int(r["utime"][0]) for r in log.values() if r.dtype.names), default=0)
    return log
