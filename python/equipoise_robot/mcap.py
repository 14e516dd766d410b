"""A log as MCAP, which Foxglove plots: every message as JSON; `equipoise convert LOG --to mcap`."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import channels as ch
from ._convert import convert
from ._data import need
from .log import Log

AT_ONCE = 4096  # messages as Python's numbers: memory does not grow with the log
Message = tuple[int, str, str]  # log time, topic, JSON


def topic_of(channel: str) -> str:
    return "equipoise/" + channel.removeprefix("EQUIPOISE_").lower()


def columns(records: np.ndarray) -> dict[str, np.ndarray]:
    """tick, then each number of a message by its field, or field_0, field_1, ... of an array."""
    found: dict[str, np.ndarray] = {}
    for name in records.dtype.names or ():
        values = records[name]
        if values.ndim > 1:
            found |= {f"{name}_{i}": column for i, column in enumerate(values.T)}
        elif name != "utime":
            found[name] = values
    return found


def messages(channel: str, records: np.ndarray) -> Iterator[Message]:
    topic = topic_of(channel)
    for at in range(0, len(records), AT_ONCE):
        piece = records[at : at + AT_ONCE]
        named = columns(piece)
        values = [v.tolist() for v in named.values()]
        for column, v in zip(values, named.values(), strict=True):
            for i in np.flatnonzero(~np.isfinite(v)):
                column[i] = None  # JSON knows no other word for it
        for utime, *row in zip(piece["utime"].tolist(), *values, strict=True):
            yield 1000 * utime, topic, json.dumps(dict(zip(named, row, strict=True)), separators=(",", ":"))


def write(log: Log, path: Path) -> str:
    """Makes the file; how many ticks it holds."""
    need("mcap", "mcap")
    from mcap.writer import Writer

    recorded = {name: records for name, records in log.items() if records.dtype.names}
    with path.open("wb") as file:
        mcap = Writer(file)
        mcap.start(library="equipoise")
        mcap.add_metadata("run", {k: str(v) for k, v in vars(log.run).items() if k != "utime"})
        numbers = {}
        for name, records in recorded.items():
            fields = {field: {"type": "number"} for field in columns(records)}
            schema = json.dumps({"type": "object", "properties": fields}).encode()
            topic = topic_of(name)
            schema_id = mcap.register_schema(topic, "jsonschema", schema)
            numbers[topic] = mcap.register_channel(topic, "json", schema_id)
        in_time = heapq.merge(*(messages(*each) for each in recorded.items()), key=lambda message: message[0])
        for t_ns, topic, text in in_time:
            mcap.add_message(numbers[topic], t_ns, text.encode(), t_ns)
        mcap.finish()
    return f"{len(log.get(ch.SENSORS, ()))} ticks"


def main(arguments: list[str] | None = None) -> int:
    return convert("mcap", __doc__, write, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
