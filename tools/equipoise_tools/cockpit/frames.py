"""Telemetry as the page takes it: messages of a tick behind each other, undecoded.

A frame: kind (1 byte: LIVE, PLAYED or HISTORY), time of the tick (8 bytes, seconds, wall clock), then for
each message the index of its channel (1 byte), its size (2 bytes) and its LCM bytes after the fingerprint.
Big-endian. A page reads fields by the layouts it is given first; what is only shown is not decoded here.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from equipoise_robot.lcm_types import message_types

from .. import names

LIVE, PLAYED, HISTORY = 1, 2, 3
# Channel -> type; the last is the one that ends a tick.
CHANNELS = {
    names.COMMAND: "command_t",
    names.STATE: "state_t",
    names.REFERENCE: "state_t",
    names.TRUTH: "state_t",
    names.MOTORS: "motors_t",
    names.TIMING_HISTOGRAM: "timing_histogram_t",
    names.FAULTS: "faults_t",
    names.HEALTH: "health_t",
    "WHAT_IF_STATE": "state_t",
    "WHAT_IF_FAULTS": "faults_t",
    names.TIMING: "timing_t",
}
WHAT_IF = {names.STATE: "WHAT_IF_STATE", names.FAULTS: "WHAT_IF_FAULTS"}  # of another tuning, beside a log's
_INDEX = {channel: index for index, channel in enumerate(CHANNELS)}
_HEAD = struct.Struct(">Bd")
_PART = struct.Struct(">BH")
_CODES = {"f8": "d", "i8": "q", "i4": "i", "i1": "b", "u1": "B", "b1": "?"}


def layouts() -> list[dict]:
    """Per channel its name, and per field name, scalar type, count and place in the message."""
    by_name = {kind.name: kind for kind in message_types().values()}
    described = []
    for channel, name in CHANNELS.items():
        fields = []
        for field_name, (dtype, offset) in by_name[name].layout.fields.items():
            base, shape = dtype.subdtype or (dtype, ())
            fields.append([field_name, _CODES[base.str[1:]], int(shape[0]) if shape else 0, offset])
        described.append({"channel": channel, "fields": fields})
    return described


def expected() -> dict[str, tuple[bytes, int]]:
    """How each channel's messages begin, and their length."""
    by_name = {
        kind.name: (kind.fingerprint, 8 + kind.layout.itemsize)
        for kind in message_types().values()
        if kind.layout
    }
    return {channel: by_name[name] for channel, name in CHANNELS.items()}


def pack(kind: int, arrived_s: float, messages: dict[str, bytes]) -> bytes:
    """`messages`: channel -> LCM bytes after the fingerprint."""
    parts = [_HEAD.pack(kind, arrived_s)]
    for channel, body in messages.items():
        parts += (_PART.pack(_INDEX[channel], len(body)), body)
    return b"".join(parts)


@dataclass
class Assembler:
    """Messages as they arrive -> one frame per tick, not more often than `interval_s`."""

    interval_s: float = 0.018  # every other tick of those that are published, 50 a second
    wanted: dict[str, tuple[bytes, int]] = field(default_factory=expected)
    newest: dict[str, bytes] = field(default_factory=dict)
    foreign: int = 0  # messages of an unknown type or version, or cut off
    last_s: float = float("-inf")
    utime: int = 0

    def take(self, channel: str, data: bytes, now_s: float) -> dict[str, bytes] | None:
        """The messages of a frame when this one completes it."""
        wanted = self.wanted.get(channel)
        if wanted is None:
            return None
        if (data[:8], len(data)) != wanted:
            self.foreign += 1
            return None
        self.newest[channel] = data[8:]
        if channel != names.TIMING or now_s - self.last_s < self.interval_s:
            return None
        self.last_s = now_s
        self.utime = int.from_bytes(data[8:16], "big", signed=True)
        complete, self.newest = self.newest, {}
        return complete
