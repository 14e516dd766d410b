"""A cockpit as tools/cockpit starts it, for the tests that talk to it."""

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

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
