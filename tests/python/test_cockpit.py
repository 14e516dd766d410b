"""The cockpit as others meet it: strangers on its port, a robot that is attached, its processes and parts."""

import asyncio
import json
import os
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from equipoise_tools import names
from equipoise_tools.cockpit import frames, words
from equipoise_tools.cockpit.playback import Playback
from equipoise_tools.cockpit.robot import private_url
from equipoise_tools.cockpit.server import QUEUE, Page
from started_cockpit import PATIENCE_S, Started, in_a_loop, talk, until
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("multicast")]


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("logs")


@pytest.mark.parametrize(
    ("who", "code"),
    [
        ({"token": "wrong"}, 4401),
        ({"token": ""}, 4401),
        ({}, 4401),  # commands before any hello
        ({"token": "right", "origin": "http://evil.example"}, 403),
        ({"token": "right", "origin": "null"}, 403),
        ({"token": "right", "host": "evil.example"}, 403),  # its name now points to 127.0.0.1
    ],
)
def test_a_stranger_is_told_nothing_and_commands_nothing(cockpit, who, code):
    if who.get("token") == "right":
        who = who | {"token": cockpit.token}
    assert in_a_loop(talk(cockpit, [{"do": "take"}, {"do": "arm"}], **who)) == code


def test_the_files_hold_no_secret_and_nothing_else_is_served(cockpit):
    async def get(path, host=None):
        try:
            reply = await AsyncHTTPClient().fetch(
                HTTPRequest(cockpit.origin + path, headers={"Host": host or cockpit.host})
            )
            return reply.code, reply.body, reply.headers
        except HTTPClientError as error:
            return error.code, b"", {}

    async def run():
        code, body, headers = await get("/")
        assert code == 200 and cockpit.token.encode() not in body
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert (await get("/", "evil.example"))[0] == 403
        for path in ("/server.py", "/../server.py", "/%2e%2e/server.py", "/package.json", "/etc/passwd"):
            assert (await get(path))[0] == 404
        assert b"http" not in re.sub(rb"http://www\.w3\.org\S*", b"", body)  # nothing from elsewhere

    in_a_loop(run())


def test_who_has_not_taken_control_cannot_drive_but_can_disarm(cockpit):
    async def run():
        def client(*requests, **until):
            return talk(cockpit, list(requests), token=cockpit.token, origin=cockpit.origin, **until)

        for do in (
            {"do": "arm"},
            {"do": "drive", "velocity_m_s": [1, 0], "yaw_hz": 0},
            {"do": "set", "changes": {}},
        ):
            await client(do, error="take control first")
        for _ in range(100):  # while the firmware starts
            events = await client({"do": "disarm"}, {"do": "logs"}, answers=4)
            if not any(event.get("error") == "no robot answers" for event in events):
                break
            await asyncio.sleep(0.1)
        assert not any("error" in event for event in events), events
        for bad in (
            {"do": "drive", "velocity_m_s": ["1", 0], "yaw_hz": 0},
            {"do": "drive"},
            {"do": "nonsense"},
        ):
            await client({"do": "take"}, bad, error=" ")
        await client({"do": "open", "log": "../../etc/passwd"}, error="no such log")

    in_a_loop(run())


def test_nothing_listens_beyond_this_machine(cockpit):
    sockets = {}
    for pid in [cockpit.process.pid, *cockpit.children()]:
        for fd in Path(f"/proc/{pid}/fd").iterdir():
            try:
                target = os.readlink(fd)
            except OSError:
                continue
            if target.startswith("socket:["):
                sockets[target[8:-1]] = pid
    listening = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{cockpit.process.pid}/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in sockets:
                listening.append(words[1])
    port = int(cockpit.host.split(":")[1])
    assert listening == [f"0100007F:{port:04X}"]


def test_an_attached_robot_without_a_key_is_read_only(root, logs):
    url = private_url()
    command = [root / "build/host/equipoise", "run", "--config", "config/edumip.toml", "--backend", "sim"]
    robot = subprocess.Popen(
        [*command, "--telemetry", url, "--log", "off", "--no-arm"],
        cwd=root,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    started = Started(root, logs, "--telemetry", url)
    try:

        async def run():
            headers = {"Origin": started.origin}
            socket = await websocket_connect(HTTPRequest(f"ws://{started.host}/socket", headers=headers))
            await socket.write_message(json.dumps({"do": "hello", "token": started.token}))
            robot_type, refused, sent = None, [], False
            while robot_type is None or len(refused) < 4:
                message = await asyncio.wait_for(socket.read_message(), PATIENCE_S)
                event = json.loads(message) if isinstance(message, str) else {}
                robot_type = event.get("status", {}).get("robot") or robot_type
                if "error" in event:
                    refused.append(event["error"])
                if "hello" in event and not sent:
                    sent = True
                    for do in ({"do": "take"}, {"do": "arm"}, {"do": "disarm"}, {"do": "restart"}):
                        await socket.write_message(json.dumps(do))
            return robot_type, refused

        robot_type, refused = in_a_loop(run())
        assert robot_type == "mip"  # by its motors: what it says of itself at its start was missed
        assert sum("no key was given" in error for error in refused) == 2
    finally:
        robot.kill()
        robot.wait()
        started.end()


def test_ends_its_robot_with_itself(root, logs):
    started = Started(root, logs)
    firmware = started.firmware()
    started.process.kill()
    started.process.wait()
    until(lambda: not Path(f"/proc/{firmware}").exists(), "the robot ends with its cockpit")


@pytest.mark.parametrize("attempt", range(3))
def test_ctrl_c_ends_it_while_its_robot_starts_anew(root, logs, attempt):
    started = Started(root, logs)
    until(lambda: len(started.children()) == 2, "robot and sender run")
    in_a_loop(talk(started, [{"do": "take"}, {"do": "restart"}], token=started.token, answers=4))
    started.end()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--config", "config/none.toml"], "config/none.toml: no such file"),
        (["--key", "robot.key"], "go with --telemetry"),
        (["--telemetry", "udpm://239.255.76.67:7667?ttl=0", "--", "--seed", "1"], "is running already"),
    ],
)
def test_bad_usage_is_named(root, arguments, said):
    done = subprocess.run(
        [sys.executable, "-m", "equipoise_tools.cockpit", "--port", "0", *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "PYTHONPATH": ":".join(sys.path)},
    )
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_a_disarm_before_the_last_line_is_carried_out(root, tmp_path):
    """Who writes `disarm` to send --live and goes away has disarmed."""
    binary, url = root / "build/host/equipoise", private_url()
    key = tmp_path / "robot.key"
    subprocess.run([binary, "keygen", key, "--robot", "one"], check=True, stdout=subprocess.DEVNULL)
    options = ["--telemetry", "off", "--log", "off", "--command-url", url, "--command-key", key]
    robot = subprocess.Popen(
        [binary, "run", "--config", "config/edumip.toml", "--backend", "sim", *options],
        cwd=root,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    send = [binary, "send", "--key", key, "--url", url, "--timeout-s", str(PATIENCE_S), "--live"]
    try:
        live = subprocess.Popen(send, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        live.stdin.write("arm\n")
        live.stdin.flush()
        for line in live.stdout:
            if json.loads(line)["state"] == "armed":
                break
        said, _ = live.communicate("drive 0.1 0 0\ndisarm\n", timeout=PATIENCE_S)
        assert live.returncode == 0
        assert json.loads(said.splitlines()[-1]) == {
            "state": "waiting",  # the turn has begun; that the loop has let go is no more waited for
            "turn": 2,
            "mine": True,
            "holder": "owner",
        }
        wrong = subprocess.run(send, input="drive 9 0 0\n", capture_output=True, text=True)
        assert wrong.returncode == 2 and "drive 9 0 0" in wrong.stderr
    finally:
        robot.kill()
        robot.wait()


def recorded(root, path):
    """A run whose encoder dies and is excluded."""
    run = [root / "build/host/equipoise", "run", "--backend", "sim", "--config", root / "config/mbbr.toml"]
    run += ["--telemetry", "off", "--speed", "50", "--arm", "--duration-s", "6", "--log", path]
    subprocess.run([*map(str, run), "--fault", "encoder_dead@3"], capture_output=True, check=True)
    return path


def test_a_log_is_filtered_again_with_another_tuning(cockpit, root, logs):
    """The page gets both runs' numbers, then frames with the other's state; a disarm does not wait for it."""
    recorded(root, logs / "died.lcm")
    noise = "estimator.ekf.r=[2.08e-6, 2.08e-6, 2.08e-6, 8e-5, 8e-5, 8e-5, 1.41, 1.41]"

    async def run():
        headers = {"Origin": cockpit.origin}
        socket = await websocket_connect(HTTPRequest(f"ws://{cockpit.host}/socket", headers=headers))

        async def say(**request):
            await socket.write_message(json.dumps(request))

        async def hear(*wanted):
            return await asyncio.wait_for(next_of(wanted), PATIENCE_S)

        async def next_of(wanted):
            while True:
                message = await socket.read_message()
                if isinstance(message, bytes):
                    if "frames" in wanted and message[0] == 0:
                        return message
                elif found := [name for name in wanted if name in json.loads(message)]:
                    return json.loads(message)[found[0]]

        await say(do="hello", token=cockpit.token)
        await hear("hello")
        await say(do="what-if", changes="safety.detection=false")
        assert "no log is open" in await hear("error")
        await say(do="open", log="died.lcm")
        await hear("playback")
        plain = await hear("frames")
        for wrong, said in (
            ("safety.detecton=false", "did you mean safety.detection"),
            ("include=['/etc/passwd']", "expected table.key=value"),
            ("--config x", "expected table.key=value"),
        ):
            await say(do="what-if", changes=wrong)
            assert said in await hear("error"), wrong
        await say(do="what-if", changes=f"safety.detection=false; {noise}")
        await say(do="what-if", changes="safety.detection=true")
        await say(do="nonsense")
        first, second = await hear("error"), await hear("error", "what_if")
        told = second if "rows" in second else await hear("what_if")
        assert "still being filtered" in first
        rows = {what: (was, then) for what, was, then in told["rows"]}
        assert told["set"] == ["safety.detection=false", noise]
        assert "without wheel" in rows["alarms"][0] and "without wheel" not in rows["alarms"][1]
        for what in ("tilt, RMS while armed", "normalised innovation, mean while armed"):
            assert rows[what][0] != rows[what][1]
        assert "is no run" in told["note"]
        assert len(await hear("frames")) > len(plain)
        await say(do="what-if", changes="")
        assert await hear("what_if") is None and len(await hear("frames")) == len(plain)
        socket.close()

    in_a_loop(run())


# Its parts.


def test_every_word_of_the_firmware_has_a_sentence():
    page = words.for_the_page()
    assert [word for word, _ in page["reasons"]] == list(names.SAFETY_REASONS)
    assert [word for word, _ in page["degraded"]] == list(names.DEGRADED)
    assert page["faults"] == list(names.FAULTS_TABLE)
    assert dict(page["reasons"])["tilt"].endswith("limit: hold it upright before arming")


def test_frames_come_at_a_bounded_rate_and_hold_one_tick():
    import equipoise

    assembler = frames.Assembler()
    taken = []
    for tick in range(1000):  # 5 s at 200 Hz
        for channel, message in ((names.STATE, equipoise.state_t()), (names.TIMING, equipoise.timing_t())):
            message.tick, message.utime = tick, 5000 * tick
            taken.append(assembler.take(channel, message.encode(), 5e-3 * tick))
    complete = [messages for messages in taken if messages is not None]
    assert len(complete) == 250
    for messages in complete:
        assert messages[names.STATE][8:16] == messages[names.TIMING][8:16]
    foreign = equipoise.health_t().encode()
    assert assembler.take(names.STATE, foreign, 99.0) is None and assembler.foreign == 1


def test_a_page_that_does_not_read_loses_old_frames_and_never_events():
    async def run():
        page = Page.__new__(Page)
        page.waiting, page.dropped, page._ready = deque(), 0, asyncio.Event()
        page.tell(event="kept")
        for i in range(1000):
            page.offer(i.to_bytes(2, "big"))
        assert len(page.waiting) == QUEUE and page.dropped == 1000 - QUEUE + 1
        assert page.waiting[0] == json.dumps({"event": "kept"})
        assert page.waiting[-1] == (999).to_bytes(2, "big")

    in_a_loop(run())


def test_frames_of_another_tuning_are_of_the_same_tick(root, tmp_path):
    log = recorded(root, tmp_path / "died.lcm")
    playback = Playback(log)
    playback.filter_again(["estimator.ekf.r=[2.08e-6, 2.08e-6, 2.08e-6, 8e-5, 8e-5, 8e-5, 1.41, 1.41]"])
    was, then = playback.log[names.STATE], playback.beside.log[names.STATE]
    assert not np.array_equal(was["theta_rad"], then["theta_rad"])
    layouts = frames.layouts()
    for t_s in (1.0, 4.5):
        message, found = playback.seek(t_s)[-1][9:], {}
        while message:
            size = int.from_bytes(message[1:3], "big")
            found[layouts[message[0]]["channel"]] = message[3 : 3 + size]
            message = message[3 + size :]
        for channel, other in frames.WHAT_IF.items():
            assert found[channel][:16] == found[other][:16]  # tick and time
            i = int(np.searchsorted(then["tick"], int.from_bytes(found[names.STATE][8:16], "big")))
        shown = then[i : i + 1]
        assert found["WHAT_IF_STATE"] == shown.astype(shown.dtype.newbyteorder(">")).tobytes()


def test_playback_finds_its_moment(known_log):
    playback = Playback(known_log)
    history = playback.seek(4.0)
    assert len(history) <= 1501 and history[-1][0] == frames.PLAYED
    assert {frame[0] for frame in history[:-1]} == {frames.HISTORY}
    assert playback.advance(1.0) is None  # paused
    playback.playing, playback.rate = True, 2.0
    assert playback.advance(1.0)[0] == frames.PLAYED
    assert playback.t_s == pytest.approx(6.0)
    playback.advance(1e6)
    assert playback.t_s == playback.last_s and not playback.playing
