"""What all pages of a cockpit share: the robot that is heard, who is in control, recording, parameters."""

from __future__ import annotations

import asyncio
import math
import re
import secrets
import time
from collections import Counter, deque
from pathlib import Path
from typing import TYPE_CHECKING

from equipoise_robot.lcm_types import message_types

import lcm

from .. import names
from ..paths import UserError
from . import frames
from .robot import Remote, SimulatedRobot, configuration

if TYPE_CHECKING:
    from .server import Page

SILENT_S = 1.0
FURTHER_PART = re.compile(r"\.\d{4,}\.lcm$")  # of a log: its first is opened


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
        self.recording: lcm.EventLog | None = None
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
        self._layouts = frames.layouts()
        self._run_kind = next(k for k in message_types().values() if k.name == "run_t")

    # From the robot.

    def hear(self, channel: str, data: bytes) -> None:
        now_s = time.time()
        if self.recording is not None and channel.startswith("EQUIPOISE_"):
            self.recording.write_event(int(now_s * 1e6), channel, data)
            self.recorded["events"] += 1
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
        frame = frames.pack(frames.LIVE, now_s - self._lag_s, messages)
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
            "heard": time.time() - self.heard_s < SILENT_S,
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
        """Notices silence."""
        heard = False
        while True:
            await asyncio.sleep(0.25)
            if heard != (time.time() - self.heard_s < SILENT_S):
                heard = not heard
                self.changed()
            if self.recording is not None:  # its size grows
                self.changed()

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
        """Whoever talks to the old robot must not be taken to talk to the new one."""
        if self.simulated is None:
            raise UserError("only a simulated robot can be started from here")
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
            self.options.logs.mkdir(parents=True, exist_ok=True)
            name = time.strftime("cockpit-%Y-%m-%dT%H-%M-%S.lcm")
            self.recording = lcm.EventLog(str(self.options.logs / name), "w", overwrite=True)
            self.recorded = {"name": name, "since_s": time.time(), "events": 0}
        elif not on and self.recording is not None:
            self.recording.close()
            self.recording = None
        self.changed()

    async def close(self) -> None:
        self.record(False)
        if self.remote is not None:
            await self.remote.stop()
        if self.simulated is not None:
            await self.simulated.stop()
