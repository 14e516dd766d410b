"""The cockpit under attack: requests that come late or in any shape, bodies, clocks, full disks."""

import asyncio
import contextlib
import json
import resource
import socket as socket_module
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from equipoise_tools import names
from equipoise_tools.cockpit.hub import Cockpit, running_s
from equipoise_tools.cockpit.robot import Child, SimulatedRobot
from started_cockpit import PATIENCE_S, in_a_loop, talk
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

import lcm

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("multicast")]


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("logs")


async def as_client(cockpit, *requests, **until):
    return await talk(cockpit, list(requests), token=cockpit.token, origin=cockpit.origin, **until)


def test_a_request_that_was_held_up_is_void(cockpit):
    drive = {"do": "drive", "velocity_m_s": [0.1, 0], "yaw_hz": 0}

    async def run():
        for late in ({"do": "arm"}, {"do": "heading-reset"}):
            seen = running_s() - 5.0
            await as_client(cockpit, {"do": "take"}, late | {"seen": seen}, error="s late and is void")
            seen = running_s() + 60.0  # of another cockpit
            await as_client(cockpit, {"do": "take"}, late | {"seen": seen}, error="is void")
            await as_client(cockpit, {"do": "take"}, late, error="not understood")
        await as_client(cockpit, {"do": "take"}, drive | {"seen": None}, error="made of numbers")
        # In time, with the beat that the cockpit sends.
        socket = await websocket_connect(
            HTTPRequest(f"ws://{cockpit.host}/socket", headers={"Origin": cockpit.origin})
        )
        await socket.write_message(json.dumps({"do": "hello", "token": cockpit.token}))
        await socket.write_message(json.dumps({"do": "take"}))
        while True:
            message = await asyncio.wait_for(socket.read_message(), PATIENCE_S)
            event = json.loads(message) if isinstance(message, str) else {}
            assert "void" not in event.get("error", "")
            if "beat" in event:
                assert 0 <= running_s() - event["beat"] < PATIENCE_S
                break
        socket.close()

    in_a_loop(run())


def test_a_request_of_any_shape_leaves_the_page_its_control(cockpit):
    drive = {"do": "drive", "yaw_hz": 0, "seen": 0}

    async def run():
        huge = json.dumps(drive | {"velocity_m_s": [0, 0]}).replace("[0,", f"[{'9' * 400},")
        socket = await websocket_connect(
            HTTPRequest(f"ws://{cockpit.host}/socket", headers={"Origin": cockpit.origin})
        )
        for text in (
            json.dumps({"do": "hello", "token": cockpit.token}),
            json.dumps({"do": "take"}),
            huge,
            "[" * 4000,
            '{"do": ' + "[" * 2000 + "]" * 2000 + "}",
            json.dumps({"do": "nonsense"}),
        ):
            await socket.write_message(text)
        while True:
            message = await asyncio.wait_for(socket.read_message(), PATIENCE_S)
            assert message is not None, "the socket was dropped"
            if isinstance(message, str) and "nonsense" in json.loads(message).get("error", ""):
                break
        socket.close()

    in_a_loop(run())


def test_a_log_that_goes_while_it_is_listed_leaves_the_page_its_control(cockpit, logs):
    """Short of space, a run deletes its own."""
    gone = logs / "gone.lcm"

    async def run():
        stop = asyncio.Event()

        async def come_and_go():
            while not stop.is_set():
                gone.write_bytes(b"")
                await asyncio.sleep(0)
                gone.unlink()
                await asyncio.sleep(0)

        both = asyncio.create_task(come_and_go())
        requests = [{"do": "take"}, *[{"do": "logs"}] * 300, {"do": "jump"}]
        told = await as_client(cockpit, *requests, error="jump: not understood")
        stop.set()
        await both
        return told

    events = in_a_loop(run())
    assert isinstance(events, list)  # not closed
    assert any("logs" in event for event in events)


def test_who_has_not_taken_control_cannot_restart_a_robot_that_runs(cockpit):
    cockpit.firmware()
    in_a_loop(as_client(cockpit, {"do": "restart"}, error="take control first"))


def test_two_pages_that_restart_at_once_get_one_robot(monkeypatch):
    """Two on one group and key would be taken for one."""

    async def run():
        hub = Cockpit(SimpleNamespace(robot="mbbr", config=None))
        hub.simulated = SimulatedRobot("", "", Path(), [], lambda: None)
        monkeypatch.setattr(hub.simulated, "command", lambda: ["sleep", "600"])
        hub.remote = SimpleNamespace(stop=lambda: asyncio.sleep(0.05), start=lambda: None)
        started = []
        begin = Child.start

        async def start(child, *arguments):
            await begin(child, *arguments)
            started.append(child)

        monkeypatch.setattr(Child, "start", start)
        await asyncio.gather(hub.restart(), hub.restart(), hub.restart())
        assert len(started) == 3 and sum(child.running for child in started) == 1
        await hub.simulated.stop()

    in_a_loop(run())


def test_who_has_not_taken_control_cannot_end_anothers_recording(cockpit):
    async def run():
        headers = {"Origin": cockpit.origin}
        owner = await websocket_connect(HTTPRequest(f"ws://{cockpit.host}/socket", headers=headers))
        for request in (
            {"do": "hello", "token": cockpit.token},
            {"do": "take"},
            {"do": "record", "on": True},
        ):
            await owner.write_message(json.dumps(request))
        while True:
            message = await asyncio.wait_for(owner.read_message(), PATIENCE_S)
            if isinstance(message, str) and json.loads(message).get("status", {}).get("recording"):
                break
        await as_client(cockpit, {"do": "record", "on": False}, error="may need what is recorded")
        await owner.write_message(json.dumps({"do": "record", "on": False}))
        while True:
            message = await asyncio.wait_for(owner.read_message(), PATIENCE_S)
            if (
                isinstance(message, str)
                and json.loads(message).get("status", {"recording": 1})["recording"] is None
            ):
                break
        owner.close()

    in_a_loop(asyncio.wait_for(run(), PATIENCE_S))


def test_half_a_character_is_a_wrong_token(cockpit):
    closed = in_a_loop(talk(cockpit, [], token="\ud800", origin=cockpit.origin))
    assert closed == 4401


def test_a_body_is_not_read_before_its_sender_is_known(cockpit):
    host, port = cockpit.host.split(":")
    with socket_module.create_connection((host, int(port)), timeout=PATIENCE_S) as stranger:
        stranger.sendall(b"POST / HTTP/1.1\r\nHost: evil.example\r\nContent-Length: 94000000\r\n\r\n")
        sent = 0
        with contextlib.suppress(ConnectionError):
            while sent < 94_000_000:
                sent += stranger.send(bytes(1 << 16))
        assert sent < 16_000_000  # what the two kernels hold


def test_frames_go_on_when_the_clock_is_set_back_and_a_suspended_machine_hears_nothing(monkeypatch):
    import equipoise

    async def run():
        hub = Cockpit(SimpleNamespace(robot="mbbr", config=None))
        shown = []
        page = SimpleNamespace(playback=None, offer=shown.append, tell=lambda **_: None)
        hub.pages = [page]

        def tick():
            time.sleep(0.02)
            hub.hear(names.STATE, equipoise.state_t().encode())
            hub.hear(names.TIMING, equipoise.timing_t().encode())

        tick()
        wall_s = time.time()
        monkeypatch.setattr("time.time", lambda: wall_s - 3600.0)
        tick()
        assert len(shown) == 2 and hub.status()["heard"]
        real = time.clock_gettime
        suspended = {time.CLOCK_BOOTTIME: 100.0}  # what the machine's other clocks have not counted
        monkeypatch.setattr("time.clock_gettime", lambda clock: real(clock) + suspended.get(clock, 0.0))
        assert not hub.status()["heard"]
        monkeypatch.undo()

    in_a_loop(run())


@pytest.mark.parametrize("change", [lambda m: m[:20], lambda m: m[:-1], lambda m: m + bytes(70_000)])
@pytest.mark.parametrize("channel", [names.STATE, names.MOTORS, names.TIMING])
def test_a_message_of_the_wrong_length_reaches_no_page(channel, change):
    import equipoise

    kinds = {
        names.STATE: equipoise.state_t,
        names.MOTORS: equipoise.motors_t,
        names.TIMING: equipoise.timing_t,
    }

    async def run():
        hub = Cockpit(SimpleNamespace(robot="", config=None))
        shown = []
        hub.pages = [SimpleNamespace(playback=None, offer=shown.append, tell=lambda **_: None)]
        for each, kind in kinds.items():
            message = kind().encode()
            hub.hear(each, change(message) if each == channel else message)
        parts = sum(3 + len(kind().encode()[8:]) for each, kind in kinds.items() if each != channel)
        assert hub.status()["foreign"] == 1
        assert [len(frame) for frame in shown] == ([] if channel == names.TIMING else [9 + parts])

    in_a_loop(run())


def test_recordings_of_one_second_are_two_and_a_full_disk_is_said(tmp_path):
    async def run():
        hub = Cockpit(SimpleNamespace(robot="mbbr", config=None, logs=tmp_path))
        written = []
        for _ in range(3):
            hub.record(True)
            hub.hear("EQUIPOISE_STATE", b"some bytes")
            written.append(hub.recorded["name"])
            hub.record(False)
        assert len(set(written)) == 3
        assert [event.data for event in lcm.EventLog(str(tmp_path / written[1]))] == [b"some bytes"]
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        hub.record(True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
        try:
            for _ in range(4):
                hub.hear("EQUIPOISE_STATE", bytes(20))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert hub.recording is None
        assert "recording stopped: " in hub.status()["recording_error"]
        assert len(list(lcm.EventLog(str(tmp_path / hub.recorded["name"])))) == 1

    in_a_loop(run())
