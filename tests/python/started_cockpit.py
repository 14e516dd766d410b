"""A cockpit as tools/cockpit starts it, for the tests that talk to it."""

import asyncio
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import WebSocketClosedError, websocket_connect

PATIENCE_S = float(
    os.environ.get("COCKPIT_PATIENCE_S", "60")
)  # for a busy machine; nothing is measured by it


def until(condition, what: str):
    """The condition's first true value."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        if value := condition():
            return value
        time.sleep(0.05)
    pytest.fail(f"never: {what}")


def in_a_loop(coroutine):
    """In a thread of its own: Playwright keeps a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, coroutine).result()


class Started:
    """A cockpit of its own process, as tools/cockpit starts it."""

    def __init__(self, root: Path, logs: Path, *arguments: str) -> None:
        environment = {**os.environ, "PYTHONPATH": ":".join(sys.path)}
        command = [sys.executable, "-m", "equipoise_tools.cockpit", "--port", "0", "--logs", str(logs)]
        self.process = subprocess.Popen(
            [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        )
        line = self.process.stdout.readline()
        assert "Open http://127.0.0.1:" in line, self.process.stderr.read()
        self.link = re.search(r"http://\S+", line)[0]
        self.origin, self.token = self.link.split("/#")
        self.host = self.origin.removeprefix("http://")

    def children(self) -> list[int]:
        pid = self.process.pid
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def firmware(self) -> int:
        def found():
            for pid in self.children():
                if b"run" in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                    return pid
            return None

        return until(found, "a simulated robot runs")

    def end(self) -> None:
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(PATIENCE_S) == 0, self.process.stderr.read()


async def talk(cockpit, requests, *, host=None, origin=None, token=None, answers=1, error=None):
    """What a WebSocket client is told: events, or the code it was closed or refused with. As many as
    `answers`, or until one has `error` in its words: others come on their own, in between."""
    headers = {"Host": host or cockpit.host} | ({"Origin": origin} if origin else {})
    try:
        socket = await websocket_connect(HTTPRequest(f"ws://{cockpit.host}/socket", headers=headers))
    except HTTPClientError as error:
        return error.code
    with contextlib.suppress(WebSocketClosedError):
        for request in [{"do": "hello", "token": token}] * (token is not None) + requests:
            await socket.write_message(json.dumps(request))
    events, end_s = [], time.monotonic() + PATIENCE_S  # frames come all the time
    while len(events) < answers if error is None else not any(error in e.get("error", "") for e in events):
        message = await asyncio.wait_for(socket.read_message(), end_s - time.monotonic())
        if message is None:
            return socket.close_code
        if isinstance(message, str) and "beat" not in json.loads(message):
            events.append(json.loads(message))
    socket.close()
    return events
