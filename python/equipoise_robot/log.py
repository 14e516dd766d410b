"""Reads an LCM event log into NumPy arrays: all its parts, also when a piece is missing or damaged."""

from __future__ import annotations

import os
import re
import struct
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import IO, TYPE_CHECKING

import numpy as np

from . import channels as ch
from ._data import need
from .errors import UserError
from .lcm_types import decode_messages

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]

# One event: sync word, number, time in microseconds, lengths of channel and data; then both. Big-endian.
_HEADER = struct.Struct(">IqqII")
_SYNC = struct.pack(">I", 0xEDA1DA01)
_LONGEST_CHANNEL = 256
_LARGEST_MESSAGE = 1 << 24
_READ_BYTES = 1 << 20
_DECODED_AT_ONCE = 4096
_CALIBRATED_AT_ONCE = 1 << 16
_MOST_CHANNELS = 200  # each takes a file; ours have twenty


def _starts_later(path: Path) -> bool:
    """An LCM log whose events are not numbered from 0: a further part of another."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(12)
    return head.startswith(_SYNC) and int.from_bytes(head[4:], "big", signed=True) > 0


def parts_of(path: Path) -> list[Path]:
    """The files of a log in order: NAME.lcm, NAME.0001.lcm, ...; the first of them may have been deleted."""
    named = re.compile(re.escape(path.stem) + r"\.(\d{4}|[1-9]\d{4,8})" + re.escape(path.suffix))
    further = []
    if path.parent.is_dir():
        further = [(int(m[1]), file) for file in path.parent.iterdir() if (m := named.fullmatch(file.name))]
    return [path] * path.exists() + [file for _, file in sorted(further) if _starts_later(file)]


def scan(path: Path, notes: list[str]) -> Iterator[tuple[int, str, bytes]]:
    """(utime, channel, message) of every intact event of one file; adds notes on what is not."""
    if path.exists() and not path.is_file():
        raise UserError(f"{path}: is no regular file")  # a pipe or a device might never end
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
                if base + at + whole > size:
                    size = os.fstat(file.fileno()).st_size  # it may be growing
                possible = channel_bytes <= _LONGEST_CHANNEL and message_bytes <= _LARGEST_MESSAGE
                if possible and base + at + whole <= size and has(whole):
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
            notes.append(f"{base + at - damaged} bytes at {damaged} are damaged and skipped")


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
            return np.asarray(np.memmap(self.file, self.dtype, mode="c"))  # type: ignore[call-overload]
        return np.concatenate(self.decoded) if self.decoded else None


class Log(dict[str, np.ndarray]):
    """A run's log: channel -> record array (an entry per message, a field per LCM field).

    All parts of a log that was rotated are read, also when a piece is missing or damaged; `notes` say what
    was wrong. The arrays are maps of temporary files: memory does not grow with the log.
    """

    def __init__(self, path: str | Path) -> None:
        """Raises UserError when it is no log or nothing of it is ours."""
        super().__init__()
        self.path = Path(path)
        self.notes: list[str] = []
        self.start_utime = 0
        self._read()
        if not self:
            raise UserError(
                f"{path}: holds no message of a type this version knows ({'; '.join(self.notes)})"
            )
        # Simulated clocks start at 0. A robot's starts at its boot, its log with the first sample.
        if ch.TRUTH not in self:
            timed = (r for r in self.values() if "utime" in (r.dtype.names or ()))
            self.start_utime = min((int(r["utime"][0]) for r in timed), default=0)

    @classmethod
    def of(cls, records: dict[str, np.ndarray]) -> Log:
        """Of a run that was recorded in memory."""
        log = cls.__new__(cls)
        dict.__init__(log, records)
        log.path, log.notes, log.start_utime = Path(), [], 0
        return log

    @property
    def run(self) -> SimpleNamespace:
        """What this is a log of: robot, seed, configuration, version."""
        if ch.RUN not in self:
            raise UserError(f"{self.path}: does not say what run it is of (no {ch.RUN} in it)")
        run: SimpleNamespace = self[ch.RUN][0]
        return run

    def seconds(self, channel: str) -> np.ndarray:
        """Time of each message since the start."""
        return (self[channel]["utime"] - self.start_utime) * 1e-6

    @property
    def duration_s(self) -> float:
        return max(
            float(self.seconds(channel)[-1])
            for channel in self
            if "utime" in (self[channel].dtype.names or ())
        )

    def sensors(self, start: int = 0, stop: int | None = None, *, every: int = 1) -> np.ndarray:
        """Samples start to stop, each or each n-th, as the firmware sees them: SI units, body axes,
        calibrated as configured in the run.

        A record array: t_s, gyro_B_rad_s, accel_B_m_s2 (gravity minus acceleration), attitude_rad, battery_V,
        wheel_angle_rad. A whole hour is 90 MB; a part of it, less.
        """
        from . import _core

        run = self.run

        def calibrated(raw: np.ndarray) -> np.ndarray:
            names = ("gyro_counts", "accel_counts", "encoder_counts", "battery_counts", "attitude_wxyz")
            # Copies: of a single row NumPy says that it is contiguous, and the core that it is not.
            packed = [np.array(raw[name], np.float64, order="C") for name in names]
            try:
                values: np.ndarray = _core.calibrated(run.robot, run.config_toml, *packed)
            except ValueError as error:
                raise UserError(f"{self.path}: {error}") from None
            return values

        wheels = calibrated(self[ch.SENSORS][:1]).shape[1] - 10
        raw = self[ch.SENSORS][start:stop:every]
        out = np.empty(
            len(raw),
            [
                ("t_s", float),
                ("gyro_B_rad_s", float, 3),
                ("accel_B_m_s2", float, 3),
                ("attitude_rad", float, 3),
                ("battery_V", float),
                ("wheel_angle_rad", float, wheels),
            ],
        )
        out["t_s"] = (raw["utime"] - self.start_utime) * 1e-6
        for at in range(0, len(raw), _CALIBRATED_AT_ONCE):  # its copies stay small
            piece = slice(at, at + _CALIBRATED_AT_ONCE)
            values = calibrated(raw[piece])
            out["gyro_B_rad_s"][piece], out["accel_B_m_s2"][piece] = values[:, 0:3], values[:, 3:6]
            out["attitude_rad"][piece], out["battery_V"][piece] = values[:, 6:9], values[:, 9]
            out["wheel_angle_rad"][piece] = values[:, 10:]
        return out

    def to_pandas(self, channel: str = ch.STATE, *, every: int = 1) -> pandas.DataFrame:
        """A channel by time in seconds, a column per number (theta_rad[0], ...); `sensors`: calibrated.

        `every`: only each n-th message, for a long log.
        """
        pandas = need("pandas", "pandas")
        if channel == "sensors":
            records = self.sensors(every=every)
            index = records["t_s"]
        elif channel not in self:
            known = ", ".join(sorted(name for name in self if self[name].dtype.names))
            raise UserError(f"{channel}: is no channel of this log; it has sensors, {known}")
        elif not self[channel].dtype.names:
            return pandas.DataFrame([vars(message) for message in self[channel]])
        else:
            records = self[channel][::every]
            index = (records["utime"] - self.start_utime) * 1e-6
        columns = {}
        for name in records.dtype.names or ():
            if name in ("utime", "t_s"):
                continue
            values = records[name]
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])}
        return pandas.DataFrame(columns, index=pandas.Index(index, name="t_s"))

    def _read(self) -> None:
        channels: dict[tuple[str, bytes], _Channel] = defaultdict(_Channel)
        broken: dict[tuple[str, bytes], str] = {}
        crowd = 0
        parts = parts_of(self.path) or [self.path]
        for part in parts:
            notes: list[str] = []
            try:
                for _, channel, message in scan(part, notes):
                    key = channel, message[:8]
                    if key in broken:
                        continue
                    if key not in channels and len(channels) >= _MOST_CHANNELS:
                        crowd += 1
                        continue
                    try:
                        channels[key].add(message)
                    except ValueError as error:
                        broken[key] = str(error)
            except OSError as error:
                raise UserError(f"{part}: {error.strerror}") from None
            self.notes += [f"{part.name}: {note}" for note in notes] if len(parts) > 1 else notes
        if not channels:
            raise UserError(f"{self.path}: is not an LCM event log, or holds no whole event")
        if crowd:
            self.notes.append(f"more than {_MOST_CHANNELS} channels: {crowd} messages are skipped")
        unknown: Counter[str] = Counter()
        for key, messages in channels.items():
            channel = key[0]
            try:
                records = None if key in broken else messages.records()
            except ValueError as error:
                broken[key] = str(error)
            if key in broken:
                self.notes.append(f"channel {channel} is skipped: {broken[key]}")
            elif records is None:
                unknown[channel] += messages.count
            elif channel in self:
                self.notes.append(f"channel {channel} changes its type; only the first is used")
            else:
                self[channel] = records
        for channel, count in unknown.items():
            self.notes.append(
                f"channel {channel}: {count} messages of an unknown type or version are skipped"
            )


def read_log(path: str | Path) -> Log:
    return Log(path)
