"""examples/foxglove_bridge.py between a simulated robot and a client that speaks Foxglove's protocol."""

import asyncio
import json
import struct
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

OPTIONAL = "tools/test installs tools/requirements-optional.txt"
pytest.importorskip("foxglove", reason=OPTIONAL)
from equipoise_tools.cockpit.robot import private_url  # noqa: E402
from tornado.httpclient import HTTPRequest  # noqa: E402
from tornado.websocket import websocket_connect  # noqa: E402

PATIENCE_S = 60.0
MESSAGE_DATA = 1  # opcode; then subscription, log time in ns, what was logged


@pytest.fixture(scope="module")
def bridge(root, multicast):
    """The address of a bridge, beside a robot whose telemetry it forwards."""
    url = private_url()
    robot = [root / "build/host/equipoise", "run", "--backend", "sim", "--config", root / "config/mbbr.toml"]
    robot += ["--arm", "--telemetry", url, "--log", "off", "--duration-s", "120"]
    started = subprocess.Popen(robot, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    command = [sys.executable, root / "examples/foxglove_bridge.py", "--url", url, "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
            started.terminate()
            started.wait()


def told(address, wanted):
    """serverInfo, channels by topic, and a (time, fields) of each wanted topic."""

    async def listen():
        request = HTTPRequest(address, headers={"Sec-WebSocket-Protocol": "foxglove.sdk.v1"})
        socket = await websocket_connect(request)
        info, channels, found = None, {}, {}
        while not set(wanted) <= set(found):
            data = await socket.read_message()
            assert data is not None, "it hung up"
            if isinstance(data, str):
                message = json.loads(data)
                if message["op"] == "serverInfo":
                    info = message
                for channel in message.get("channels", []):
                    channels[channel["topic"]] = channel
                    asked = {"id": channel["id"], "channelId": channel["id"]}
                    await socket.write_message(json.dumps({"op": "subscribe", "subscriptions": [asked]}))
            elif data[0] == MESSAGE_DATA:
                subscription, log_ns = struct.unpack_from("<IQ", data, 1)
                (topic,) = [t for t, channel in channels.items() if channel["id"] == subscription]
                found[topic] = log_ns, json.loads(data[13:])
        socket.close()
        return info, channels, found

    with ThreadPoolExecutor(1) as own:  # playwright leaves the main thread with a running loop
        return own.submit(lambda: asyncio.run(asyncio.wait_for(listen(), PATIENCE_S))).result()


def test_the_shipped_layout_shows_it_live(root, bridge):
    layout = json.loads((root / "config/foxglove-layout.json").read_text())["configById"]
    paths = [path["value"] for panel in layout.values() for path in panel.get("paths", [])]
    live = {path for path in paths if not path.startswith("equipoise/truth.")}  # which a robot has not
    _, channels, found = told(bridge, {path.split(".")[0] for path in live})
    assert len(live) > 5
    for path in live:
        topic, field = path.split(".")
        _, fields = found[topic]
        assert isinstance(fields[field], (int, float)), path
        assert channels[topic]["encoding"] == "json"
        assert field in json.loads(channels[topic]["schema"])["properties"]
    log_ns, fields = found["equipoise/state"]
    assert fields["tick"] > 0 and log_ns == pytest.approx(5_000_000 * fields["tick"], abs=1e9)


def test_clients_can_only_read_and_only_from_this_machine(bridge):
    info, _, _ = told(bridge, {"equipoise/state"})
    assert info["capabilities"] == []  # no publishing, no parameters, no services
    port = int(bridge.rsplit(":", 1)[1])
    with open("/proc/net/tcp") as table:
        listening = [row.split()[1] for row in table if row.split()[3] == "0A"]
    assert [place for place in listening if place.endswith(f":{port:04X}")] == [f"0100007F:{port:04X}"]
