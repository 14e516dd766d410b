"""What all pages of a cockpit share: the robot that is heard, who is in control, recording, parameters."""

from __future__ import annotations

import asyncio
import errno
import itertools
import math
import os
import re
import secrets
import struct
import time
from collections import Counter, deque
from pathlib import Path
from typing import TYPE_CHECKING

from equipoise_robot.lcm_types import message_types

from .. import names
from ..paths import UserError
from . import frames
from .robot import Remote, SimulatedRobot, configuration

if TYPE_CHECKING:
    from .server import Page

SILENT_S = 1.0
BEAT_S = 0.1
FURTHER_PART = re.compile(r"\.\d{4,}\.lcm$")  # of a log: its first is opened


def running_s() -> float:
    """Since the machine's start: nobody sets it, and it goes on while the machine is suspended."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class EventLog:
    """An LCM event log. An event is in the file, whole, or an OSError says why not."""

    _HEAD = struct.Struct(">IqqII")

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("xb", buffering=0)
        self._bytes = self._events = 0

    @classmethod
    def new(cls, folder: Path, stem: str) -> EventLog:
        """Under a name that nothing has yet."""
        for number in itertools.count(1):
            try:
                return cls(folder / (f"{stem}-{number}.lcm" if number > 1 else f"{stem}.lcm"))
            except FileExistsError:
                continue
        raise AssertionError

    def write(self, utime: int, channel: str, data: bytes) -> None:
        name = channel.encode()
        event = self._HEAD.pack(0xEDA1DA01, self._events, utime, len(name), len(data)) + name + data
        try:
            written = self._file.write(event)
            if written != len(event):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            self._file.truncate(self._bytes)
            raise
        self._bytes += len(event)
        self._events += 1

    def close(self) -> None:
        self._file.close()


class Cockpit:
    def __init__(self, options) -> None:
        self.options = options
        self.token = secrets.token_urlsafe(24)
        self.port = 0
        self.pages: set[Page] = set()
        self.in_control: Page | None = None
        self.simulated: SimulatedRobot | None = None
        self.remote: Remote | None = None
        self.run: dict | None = None
        self.robot = options.robot
        self.parameters: list[dict] = []
        self.parameter_error = ""
        self.recording: EventLog | None = None
        self.recording_error = ""
        self.recorded: dict | None = None
        self.assembler = frames.Assembler()
        self.heard_s = -math.inf
        self.frames = 0
        self.refused: Counter[str] = Counter()
        self.seen: deque[dict] = deque(maxlen=600)  # pages' own measurements, for tests and the curious
        self._least_lag_s = math.inf
        self._lag_s = 0.0
        self._told = ""
        self._soon: asyncio.Handle | None = None
        self._loop = asyncio.get_running_loop()
        self._starting = asyncio.Lock()
        self._layouts = frames.layouts()
        self._run_kind = next(k for k in message_types().values() if k.name == "run_t")

    # From the robot.

    def hear(self, channel: str, data: bytes) -> None:
        now_s = running_s()
        if self.recording is not None and channel.startswith("EQUIPOISE_"):
            self._keep(channel, data)
        if channel == names.RUN:
            self._hear_run(data)
            return
        messages = self.assembler.take(channel, data, now_s)
        if messages is None:
            return
        if now_s - self.heard_s > SILENT_S:
            self._least_lag_s = math.inf
            self.changed()
        self.heard_s = now_s
        lag_s = now_s - self.assembler.utime * 1e-6
        if abs(lag_s - self._least_lag_s) > 1.0:  # the robot has started anew
            self._least_lag_s = lag_s
        self._least_lag_s = min(self._least_lag_s, lag_s)
        self._lag_s = lag_s - self._least_lag_s
        if names.MOTORS in messages and not self.robot:
            wheels = int.from_bytes(messages[names.MOTORS][16:20], "big")
            self.robot = "mip" if wheels == 2 else "mbbr"
            self.changed()
        self.frames += 1
        frame = frames.pack(frames.LIVE, time.time() - self._lag_s, messages)
        for page in self.pages:
            if page.playback is None:
                page.offer(frame)

    def _hear_run(self, data: bytes) -> None:
        try:
            run = self._run_kind.decode(data)
        except Exception:  # generated decoders raise whatever struct does on a short message
            return
        self.robot = run.robot
        self.run = {
            key: getattr(run, key)
            for key in ("robot", "estimator", "controller", "fidelity", "version", "backend")
        }
        self.changed()

    # To the pages.

    def status(self) -> dict:
        return {
            "robot": self.robot,
            "run": self.run,
            "heard": running_s() - self.heard_s < SILENT_S,
            "simulated": self.simulated
            and {
                "running": self.simulated.running,
                "starts": self.simulated.starts,
                "last_words": self.simulated.last_words,
                "overrides": self.simulated.overrides,
            },
            "remote": self.remote and {"status": self.remote.status, "error": self.remote.error},
            "controlled": self.in_control is not None,
            "recording": self.recorded if self.recording is not None else None,
            "recording_error": self.recording_error,
            "foreign": self.assembler.foreign,
            "parameter_error": self.parameter_error,
        }

    def changed(self) -> None:
        """Tells the pages, once for many changes."""
        if self._soon is None:
            self._soon = self._loop.call_soon(self._tell)

    def _tell(self) -> None:
        self._soon = None
        status = self.status()
        for page in self.pages:
            page.tell(status=status | {"mine": page is self.in_control})

    async def watch(self) -> None:
        """Notices silence; tells the pages the time, which they give back with what a person does."""
        heard = False
        while True:
            await asyncio.sleep(BEAT_S)
            for page in self.pages:
                page.beat(running_s())
            if heard != (running_s() - self.heard_s < SILENT_S):
                heard = not heard
                self.changed()
            if self.recording is not None:  # its size grows
                self.changed()

    @property
    def fresh_s(self) -> float:
        """How old a request may be: a command's age, on the way to the page and on the way back."""
        timeouts = [p["value"] for p in self.parameters if p["key"] == "safety.command_timeout_s"]
        return 2.0 * (float(timeouts[0]) if timeouts else 0.5)

    async def load_parameters(self) -> None:
        if self.options.config is None:
            return
        overrides = dict(self.simulated.overrides) if self.simulated else {}
        self.parameters = await asyncio.to_thread(configuration, self.options.config, overrides)
        for page in self.pages:
            page.tell(parameters=self.parameters)

    def geometry(self) -> dict:
        return {
            p["key"].removeprefix("robot."): p["value"]
            for p in self.parameters
            if p["key"].startswith("robot.")
        }

    def logs(self) -> list[dict]:
        folder = self.options.logs
        found = [p for p in folder.rglob("*.lcm") if p.is_file() and not FURTHER_PART.search(p.name)]
        newest = sorted(found, key=lambda p: p.stat().st_mtime, reverse=True)[:100]
        return [{"name": str(p.relative_to(folder)), "bytes": p.stat().st_size} for p in newest]

    def log_path(self, name: str) -> Path:
        """Only what the list shows can be opened."""
        if name not in {log["name"] for log in self.logs()}:
            raise UserError(f"{name}: no such log in {self.options.logs.name}")
        return self.options.logs / name

    # From the pages.

    async def restart(self) -> None:
        """Whoever talks to the old robot must not be taken to talk to the new one; two pages that ask at once
        get one robot."""
        if self.simulated is None:
            raise UserError("only a simulated robot can be started from here")
        async with self._starting:
            await self.remote.stop()
            await self.simulated.start()
            self.heard_s = -math.inf
            self.remote.start()

    async def set_parameters(self, changes: dict[str, str]) -> None:
        """Simulation: checked by the firmware's own reader, then the robot starts anew with them."""
        if self.simulated is None:
            raise UserError("parameters of a robot are read-only here: change its configuration file")
        wanted = {str(k): str(v) for k, v in changes.items()}
        known = {p["key"] for p in self.parameters}
        if unknown := sorted(set(wanted) - known):
            raise UserError(f"{unknown[0]}: no such parameter")
        overrides = self.simulated.overrides | wanted
        await asyncio.to_thread(configuration, self.options.config, overrides)
        self.simulated.overrides = overrides
        await self.restart()
        await self.load_parameters()

    def record(self, on: bool) -> None:
        if on and self.recording is None:
            self.recording_error = ""
            try:
                self.options.logs.mkdir(parents=True, exist_ok=True)
                self.recording = EventLog.new(self.options.logs, time.strftime("cockpit-%Y-%m-%dT%H-%M-%S"))
            except OSError as error:
                raise UserError(f"recording: {self.options.logs}: {error.strerror}") from None
            self.recorded = {"name": self.recording.path.name, "since_s": time.time(), "events": 0}
        elif not on and self.recording is not None:
            self.recording.close()
            self.recording = None
        self.changed()

    def _keep(self, channel: str, data: bytes) -> None:
        try:
            self.recording.write(int(time.time() * 1e6), channel, data)
            self.recorded["events"] += 1
        except OSError as error:
            self.recording_error = f"{self.recording.path.name}: recording stopped: {error.strerror}"
            self.record(False)

    async def close(self) -> None:
        await self._starting.acquire()  # for good: a restart has ended, and none begins
        self.record(False)
        if self.remote is not None:
            await self.remote.stop()
        if self.simulated is not None:
            await self.simulated.stop()
