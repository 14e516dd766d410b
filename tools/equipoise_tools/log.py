"""Reads an LCM event log into NumPy arrays: all its parts, also when a piece is missing or damaged."""

from __future__ import annotations

import re
import struct
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from . import names
from .lcm_types import decode_messages
from .paths import UserError

# One event: sync word, number, time in microseconds, lengths of channel and data; then both. Big-endian.
_HEADER = struct.Struct(">IqqII")
_SYNC = struct.pack(">I", 0xEDA1DA01)
_LONGEST_CHANNEL = 256
_LARGEST_MESSAGE = 1 << 24
_READ_BYTES = 1 << 20
_DECODED_AT_ONCE = 4096


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


def parts_of(path: Path) -> list[Path]:
    """The files of a log in order: NAME.lcm, NAME.0001.lcm, ...; the first of them may have been deleted."""
    named = re.compile(re.escape(path.stem) + r"\.(\d{4,})" + re.escape(path.suffix))
    further = []
    if path.parent.is_dir():
        further = [(int(m[1]), file) for file in path.parent.iterdir() if (m := named.fullmatch(file.name))]
    return [path] * path.exists() + [file for _, file in sorted(further)]


def scan(path: Path, notes: list[str]) -> Iterator[tuple[int, str, bytes]]:
    """(utime, channel, message) of every intact event of one file; adds notes on what is not."""
    with path.open("rb") as file:
        size = path.stat().st_size
        data, base, at = b"", 0, 0  # data[0] stands at `base` in the file
        channels: dict[bytes, str] = {}

        def has(wanted: int) -> bool:
            nonlocal data, base, at
            if len(data) - at >= wanted:
                return True
            data, base, at = data[at:] + file.read(max(_READ_BYTES, wanted)), base + at, 0
            return len(data) >= wanted

        def skip_to_sync() -> bool:
            nonlocal at
            at += 1
            while has(len(_SYNC)):
                found = data.find(_SYNC, at)
                at = found if found >= 0 else len(data) - len(_SYNC) + 1
                if found >= 0:
                    return True
            return False

        while has(1):
            if has(_HEADER.size) and data.startswith(_SYNC, at):
                _, _, utime, channel_bytes, message_bytes = _HEADER.unpack_from(data, at)
                whole = _HEADER.size + channel_bytes + message_bytes
                if channel_bytes <= _LONGEST_CHANNEL and message_bytes <= _LARGEST_MESSAGE and has(whole):
                    body = at + _HEADER.size
                    name = data[body : body + channel_bytes]
                    if name not in channels:
                        channels[name] = name.decode(errors="replace")
                    at += whole
                    yield utime, channels[name], data[body + channel_bytes : at]
                    continue
            damaged = base + at
            if not skip_to_sync():
                notes.append(f"cut off after {damaged} of {size} bytes; what precedes is used")
                return
            notes.append(f"{base + at - damaged} bytes at {damaged} are damaged and left out")


class _Channel:
    """Messages of one channel and type, in a temporary file: memory does not grow with the log."""

    def __init__(self) -> None:
        self.messages: list[bytes] = []
        self.decoded: list[np.ndarray] = []  # of types that hold strings: few
        self.file: IO[bytes] | None = None
        self.dtype: np.dtype | None = None
        self.count = 0
        self.known = True

    def add(self, message: bytes) -> None:
        self.count += 1
        if self.known:
            self.messages.append(message)
            if len(self.messages) >= _DECODED_AT_ONCE:
                self.flush()

    def flush(self) -> None:
        if not self.messages:
            return
        records = decode_messages(self.messages)
        self.messages = []
        if records is None:
            self.known = False
        elif records.dtype.hasobject:
            self.decoded.append(records)
        else:
            if self.file is None:  # lives as long as the array over it
                self.file = tempfile.TemporaryFile(prefix="equipoise-log-")  # noqa: SIM115
            self.dtype = records.dtype
            self.file.write(records.tobytes())

    def records(self) -> np.ndarray | None:
        """None: a type this version does not know."""
        self.flush()
        if self.file is not None:
            self.file.flush()
            return np.asarray(np.memmap(self.file, self.dtype, mode="c"))
        return np.concatenate(self.decoded) if self.decoded else None


def read_log(path: str | Path) -> Log:
    """The log's channels, of all its parts. Raises UserError when it is no log or nothing of it is ours."""
    path = Path(path)
    log = Log(path)
    channels: dict[tuple[str, bytes], _Channel] = defaultdict(_Channel)
    broken: dict[tuple[str, bytes], str] = {}
    parts = parts_of(path) or [path]
    for part in parts:
        notes: list[str] = []
        try:
            for _, channel, message in scan(part, notes):
                key = channel, message[:8]
                if key in broken:
                    continue
                try:
                    channels[key].add(message)
                except ValueError as error:
                    broken[key] = str(error)
        except OSError as error:
            raise UserError(f"{part}: {error.strerror}") from None
        log.notes += [f"{part.name}: {note}" for note in notes] if len(parts) > 1 else notes
    if not channels:
        raise UserError(f"{path}: is not an LCM event log, or holds no whole event")
    unknown: Counter[str] = Counter()
    for key, messages in channels.items():
        channel = key[0]
        try:
            records = None if key in broken else messages.records()
        except ValueError as error:
            broken[key] = str(error)
        if key in broken:
            log.notes.append(f"channel {channel} is left out: {broken[key]}")
        elif records is None:
            unknown[channel] += messages.count
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
