"""A robot's telemetry live in Foxglove: pip install foxglove-sdk, then

python examples/foxglove_bridge.py [--url LCM_URL] [--port 8765]

Topics and fields are those of `equipoise convert --to mcap`, so config/foxglove-layout.json shows them. It
only reads: clients can publish nothing, and it listens on this machine alone.
"""

import argparse
import json
import math

import foxglove
from equipoise_robot.lcm_types import message_types

import lcm

TELEMETRY = "udpm://239.255.76.67:7667?ttl=0"  # where `equipoise` publishes, on this host


def fields_of(message):
    """name -> number or None, where JSON has no word for it; name_0, name_1, ... of an array."""
    for name, value in vars(message).items():
        values = {name: value}
        if isinstance(value, (list, tuple)):
            values = {f"{name}_{i}": element for i, element in enumerate(value)}
        for each, number in values.items():
            if isinstance(number, (int, float)):
                yield each, number if math.isfinite(number) else None


class Bridge:
    """From LCM's channels to Foxglove's."""

    def __init__(self) -> None:
        self.channels: dict[str, foxglove.Channel] = {}

    def take(self, name: str, data: bytes) -> None:
        kind = message_types().get(bytes(data[:8]))
        if kind is None:
            return
        message = kind.decode(data)
        fields = dict(fields_of(message))
        utime = fields.pop("utime", None)
        if utime is None:
            return
        if name not in self.channels:
            numbers = {field: {"type": "number"} for field in fields}
            topic = "equipoise/" + name.removeprefix("EQUIPOISE_").lower()
            schema = {"type": "object", "properties": numbers}
            self.channels[name] = foxglove.Channel(topic, schema=schema, message_encoding="json")
        self.channels[name].log(json.dumps(fields).encode(), log_time=1000 * utime)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--url", default=TELEMETRY, help="LCM's; default: where equipoise publishes")
    parser.add_argument("--port", type=int, default=8765, help="of the WebSocket on 127.0.0.1; 0: any")
    given = parser.parse_args()
    source = lcm.LCM(given.url)
    bridge = Bridge()
    source.subscribe("EQUIPOISE_.*", bridge.take)
    server = foxglove.start_server(name="equipoise", host="127.0.0.1", port=given.port, capabilities=[])
    print(f"ws://127.0.0.1:{server.port}", flush=True)
    try:
        while True:
            source.handle()
    except KeyboardInterrupt:
        server.stop()


if __name__ == "__main__":
    main()
