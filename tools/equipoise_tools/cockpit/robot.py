"""Processes behind the cockpit: the simulated robot, and the sender that signs what the page asks for."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import subprocess
from collections import deque
from collections.abc import Callable
from pathlib import Path

from ..paths import UserError, repository_root

KEPT_LINES = 20
HOLDER = "cockpit"


def binary() -> Path:
    path = repository_root() / "build/host/equipoise"
    if not path.is_file():
        raise UserError(f"{path.relative_to(repository_root())}: not built; run ./tools/run once")
    return path


def private_url() -> str:
    """An LCM URL of this cockpit alone, kept on this host: two robots on one would be taken for one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"udpm://239.255.76.67:{probe.getsockname()[1]}?ttl=0"


def make_key(folder: Path, robot: str) -> Path:
    key = folder / "robot.key"
    subprocess.run(
        [binary(), "keygen", key, "--robot", robot], check=True, stdout=subprocess.DEVNULL, timeout=30
    )
    return key


def configuration(config: str, overrides: dict[str, str]) -> list[dict]:
    """Every parameter in force, as `config explain` has it; UserError says what is wrong with an override."""

    def ask(*arguments: str) -> dict:
        command = [binary(), "config", *arguments, "--config", config, "--json", "-"]
        for key, value in overrides.items():
            command += ["--set", f"{key}={value}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, cwd=repository_root())
        if done.returncode:
            raise UserError(done.stderr.strip().removeprefix("equipoise: "))
        return json.loads(done.stdout)

    tables = sorted({key.split(".")[0] for key in ask("show")} - {"world"})
    return [row for table in tables for row in ask("explain", table)["keys"]]


class Child:
    """A process whose lines are read as they come. `ended` is called once, when it is gone."""

    def __init__(self, ended: Callable[[int], None]) -> None:
        self._ended = ended
        self.process: asyncio.subprocess.Process | None = None
        self.errors: deque[str] = deque(maxlen=KEPT_LINES)
        self.output: deque[str] = deque(maxlen=KEPT_LINES)
        self._watch: asyncio.Task | None = None

    async def start(self, command: list[str], heard: Callable[[str], None] | None = None) -> None:
        self.process = await asyncio.create_subprocess_exec(
            *command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=repository_root(),
            start_new_session=True,  # Ctrl-C is ours to pass on, in order
            preexec_fn=_die_with_parent,
        )
        self._watch = asyncio.create_task(self._follow(heard))

    async def _follow(self, heard: Callable[[str], None] | None) -> None:
        async def read(stream: asyncio.StreamReader, kept: deque, tell: Callable[[str], None] | None) -> None:
            async for line in stream:
                text = line.decode(errors="replace").rstrip()
                kept.append(text)
                if tell:
                    tell(text)

        await asyncio.gather(
            read(self.process.stdout, self.output, heard), read(self.process.stderr, self.errors, None)
        )
        self._ended(await self.process.wait())

    @property
    def running(self) -> bool:
        return self.process is not None and self.process.returncode is None

    def write(self, line: str) -> bool:
        """False: it is gone, or does not read."""
        if not self.running or self.process.stdin.transport.get_write_buffer_size() > 1 << 14:
            return False
        self.process.stdin.write(f"{line}\n".encode())
        return True

    async def stop(self) -> None:
        """SIGTERM, which both programs take as an orderly end, and SIGKILL for one that hangs."""
        if self.process is None:
            return
        if self.running:
            self.process.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(asyncio.shield(self._watch), 5.0)
        except TimeoutError:
            self.process.kill()
            await self._watch


def _die_with_parent() -> None:
    """Linux: no simulated robot outlives its cockpit, however that ends."""
    import ctypes

    ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
    if os.getppid() == 1:
        os.kill(os.getpid(), signal.SIGTERM)


class SimulatedRobot:
    """`equipoise run --backend sim`, started and started anew."""

    def __init__(
        self, config: str, url: str, key: Path, extra: list[str], changed: Callable[[], None]
    ) -> None:
        self.config, self.url, self.key, self.extra = config, url, key, extra
        self.overrides: dict[str, str] = {}
        self.starts = 0
        self.last_words = ""
        self._changed = changed
        self._child: Child | None = None

    def command(self) -> list[str]:
        command = [str(binary()), "run", "--config", self.config, "--backend", "sim", "--log", "off"]
        command += ["--telemetry", self.url, "--command-url", self.url, "--command-key", str(self.key)]
        for key, value in self.overrides.items():
            command += ["--set", f"{key}={value}"]
        return command + self.extra

    async def start(self) -> None:
        await self.stop()
        self.starts += 1
        self.last_words = ""
        child = self._child = Child(lambda status: self._gone(child, status))
        await child.start(self.command())
        self._changed()

    def _gone(self, child: Child, status: int) -> None:
        if child is not self._child:
            return
        said = [line for line in [*child.output, *child.errors] if line and not line.startswith(" ")]
        self.last_words = said[0].removeprefix("equipoise: ") if said else f"ended with status {status}"
        if status == 2 and child.errors:  # bad input: its error says which
            self.last_words = child.errors[-1].removeprefix("equipoise: ")
        self._changed()

    @property
    def running(self) -> bool:
        return self._child is not None and self._child.running

    @property
    def pid(self) -> int | None:
        return self._child.process.pid if self.running else None

    async def stop(self) -> None:
        if self._child is not None:
            await self._child.stop()


class Remote:
    """`equipoise send --live`: the only thing here that commands a robot. One process per robot start."""

    RETRY_S = 0.5

    def __init__(self, url: str, key: Path, holder: str | None, changed: Callable[[], None]) -> None:
        self.command = [str(binary()), "send", "--key", str(key), "--url", url, "--live"]
        self.command += ["--as", holder] if holder else []
        self.status: dict | None = None  # what the robot has confirmed; None: no robot
        self.error = ""
        self._changed = changed
        self._child: Child | None = None
        self._task: asyncio.Task | None = None

    def start(self) -> None:
        if self._task is None:
            self._task = asyncio.create_task(self._keep_talking())

    async def _keep_talking(self) -> None:
        """Whenever the robot is gone, waits for its next start."""
        while True:
            gone = asyncio.Event()
            child = self._child = Child(lambda _, gone=gone: gone.set())
            await child.start(self.command, self._heard)
            await gone.wait()
            self.status = None
            self.error = child.errors[-1].removeprefix("equipoise: ") if child.errors else ""
            self._changed()
            await asyncio.sleep(self.RETRY_S)

    def _heard(self, line: str) -> None:
        self.status, self.error = json.loads(line), ""
        self._changed()

    async def first_status(self) -> None:
        while self.status is None:
            await asyncio.sleep(0.05)

    def say(self, line: str) -> bool:
        return self._child is not None and self.status is not None and self._child.write(line)

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None
        if self._child is not None:
            await self._child.stop()
        self.status = None
        self._changed()
