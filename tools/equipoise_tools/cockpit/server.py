"""Between robot, sender and pages: a WebSocket for whoever holds the link's token, and the page's files."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import json
import math
import re
import time
from collections import deque
from pathlib import Path

import tornado.httpserver
import tornado.web
import tornado.websocket

from ..paths import UserError, repository_root
from . import words
from .hub import Cockpit, running_s
from .playback import MAX_RATE, Playback

HERE = Path(__file__).parent / "page"
MODULES = repository_root() / "build/page/node_modules"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
QUEUE = 64  # frames that may wait for one page; a slower page misses some
MAX_REQUEST = 4096  # bytes
SETTING = re.compile(r"[a-z]\w*(\.\w+)+\s*=")  # of a key in a table: no include, no other option
LIBRARIES = {
    "three.module.js": "three/build/three.module.js",
    "three.core.js": "three/build/three.core.js",
    "OrbitControls.js": "three/examples/jsm/controls/OrbitControls.js",
    "uPlot.esm.js": "uplot/dist/uPlot.esm.js",
    "uPlot.min.css": "uplot/dist/uPlot.min.css",
}
_IMPORT_MAP = re.search(r'<script type="importmap">(.*?)</script>', (HERE / "index.html").read_text(), re.S)[
    1
]
_IMPORT_MAP_HASH = base64.b64encode(hashlib.sha256(_IMPORT_MAP.encode()).digest()).decode()
SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
    f"script-src 'self' 'sha256-{_IMPORT_MAP_HASH}'; frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def number(value, limit: float) -> float:
    finite = isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
    if not finite or isinstance(value, bool):
        raise UserError("a motion is made of numbers")
    return float(min(max(value, -limit), limit))  # limited first: an integer may have 400 digits


class Page(tornado.websocket.WebSocketHandler):
    """One browser tab. Until it has shown the token it is told nothing and asked nothing."""

    HELLO_S = 5.0

    def initialize(self, cockpit: Cockpit) -> None:
        self.cockpit = cockpit
        self.welcome = False
        self.playback: Playback | None = None
        self.waiting: deque[bytes | str] = deque()
        self.dropped = 0
        self._beat_s: float | None = None  # the newest, not yet sent
        self._ready = asyncio.Event()
        self._sender: asyncio.Task | None = None
        self._player: asyncio.Task | None = None
        self._filtering: asyncio.Task | None = None

    def check_origin(self, origin: str) -> bool:
        """Only our own page, whatever name another one gives this address."""
        allowed = own_hosts(self.cockpit.port)
        ok = origin in {f"http://{host}" for host in allowed} and self.request.host in allowed
        self.cockpit.refused["origin"] += not ok
        return ok

    def prepare(self) -> None:
        # A client that names no origin is no browser; it may come, but needs the token all the same.
        if self.request.host not in own_hosts(self.cockpit.port):
            self.cockpit.refused["host"] += 1
            raise tornado.web.HTTPError(403)

    def open(self) -> None:
        self.set_nodelay(True)
        asyncio.get_running_loop().call_later(self.HELLO_S, self._unwelcome)

    def _unwelcome(self) -> None:
        if not self.welcome:
            self.close(4401, "no token")

    def offer(self, frame: bytes) -> None:
        """The oldest frames of a page that is too slow are dropped."""
        if len(self.waiting) >= QUEUE:
            oldest = next((i for i, item in enumerate(self.waiting) if isinstance(item, bytes)), None)
            if oldest is None:
                return
            del self.waiting[oldest]
            self.dropped += 1
        self.waiting.append(frame)
        self._ready.set()

    def tell(self, **event) -> None:
        self.waiting.append(json.dumps(event))
        self._ready.set()
        if len(self.waiting) > 4 * QUEUE:  # it does not read at all
            self.close(4408, "too slow")

    def beat(self, now_s: float) -> None:
        """However slow the page is, one waits."""
        self._beat_s = now_s
        self._ready.set()

    async def _send(self) -> None:
        try:
            while True:
                await self._ready.wait()
                self._ready.clear()
                if self._beat_s is not None:
                    beat_s, self._beat_s = self._beat_s, None
                    await self.write_message(json.dumps({"beat": beat_s}))
                while self.waiting:
                    item = self.waiting.popleft()
                    await self.write_message(item, binary=isinstance(item, bytes))
        except tornado.websocket.WebSocketClosedError:
            pass

    async def on_message(self, message: str | bytes) -> None:
        try:
            request = json.loads(message)
            do = str(request["do"])
        except (ValueError, TypeError, KeyError, RecursionError):
            if self.welcome:
                self.tell(error="not a request")
            else:
                self.close(4400, "not a request")
            return
        if not self.welcome:
            self._greet(do, request)
            return
        try:
            await self._obey(do, request)
        except UserError as error:
            self.tell(error=str(error))
        except OSError as error:  # a log may be deleted while it is looked for
            self.tell(error=f"{do}: {error.strerror}")
        except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError):
            self.tell(error=f"{do}: not understood")

    def _greet(self, do: str, request: dict) -> None:
        token = request.get("token")
        if do != "hello" or not isinstance(token, str):
            token = ""
        shown = token.encode(errors="replace")  # JSON can write half a character
        if not hmac.compare_digest(shown, self.cockpit.token.encode()):
            self.cockpit.refused["token"] += 1
            self.close(4401, "wrong token")
            return
        self.welcome = True
        self._sender = asyncio.create_task(self._send())
        cockpit = self.cockpit
        self.tell(
            hello={
                "channels": cockpit._layouts,
                "words": words.for_the_page(),
                "title": cockpit.options.title,
                "can_command": cockpit.remote is not None,
                "can_restart": cockpit.simulated is not None,
            }
        )
        self.tell(parameters=cockpit.parameters)
        self.tell(status=cockpit.status() | {"mine": False})
        cockpit.pages.add(self)

    async def _obey(self, do: str, request: dict) -> None:
        cockpit = self.cockpit
        if do == "disarm":  # from any page, at any time
            self._command("disarm")
        elif do == "take":
            if cockpit.remote is None:
                raise UserError("read-only: no key was given (--key)")
            cockpit.in_control = self
            cockpit.remote.say("take")
            cockpit.changed()
        elif do == "release":
            self._release()
        elif do in ("arm", "heading-reset", "drive"):
            if cockpit.in_control is not self:
                raise UserError("read-only: take control first")
            if self.playback is not None:
                raise UserError("a log is being played: close it first")
            line = do
            if do == "drive":
                forward, left = (number(v, 2.0) for v in request["velocity_m_s"])
                line = f"drive {forward:.4f} {left:.4f} {number(request['yaw_hz'], 5.0):.4f}"
            age_s = running_s() - number(request["seen"], 1e15)
            if 0 <= age_s <= cockpit.fresh_s:
                self._command(line, quiet=do == "drive")
            elif do != "drive":
                raise UserError(f"{do}: came {age_s:.1f} s late and is void: the connection was held up")
        elif do == "seen":
            cockpit.seen.append(request["page"] | {"lag_s": cockpit._lag_s, "dropped": self.dropped})
        elif do == "record":
            if not request["on"] and cockpit.in_control not in (None, self):
                raise UserError("read-only: another page is in control and may need what is recorded")
            cockpit.record(bool(request["on"]))
        elif do == "restart":
            running = cockpit.simulated is not None and cockpit.simulated.running
            if running and cockpit.in_control is not self:
                raise UserError("read-only: take control first")
            await cockpit.restart()
        elif do == "set":
            if cockpit.in_control is not self:
                raise UserError("read-only: take control first")
            await cockpit.set_parameters(dict(request["changes"]))
        elif do == "logs":
            self.tell(logs=await asyncio.to_thread(cockpit.logs))
        else:
            await self._play(do, request)

    def _command(self, line: str, quiet: bool = False) -> None:
        remote = self.cockpit.remote
        if remote is None:
            raise UserError("read-only: no key was given (--key)")
        if not remote.say(line) and not quiet:
            raise UserError(remote.error or "no robot answers")

    async def _play(self, do: str, request: dict) -> None:
        if do == "open":
            path = self.cockpit.log_path(str(request["log"]))
            playback = await asyncio.to_thread(Playback, path)
            described = await asyncio.to_thread(playback.describe)
            if self.ws_connection is None:  # closed meanwhile: nobody would end the player
                return
            self.playback = playback
            self.tell(playback=described)
            self._show(self.playback.seek(self.playback.first_s))
            if self._player is None:
                self._player = asyncio.create_task(self._keep_playing())
        elif do == "close":
            self.playback = None
            self.tell(playback=None)
        elif self.playback is None:
            known = do in ("play", "pause", "seek", "what-if")
            raise UserError(f"{do}: no log is open" if known else f"{do}: not understood")
        elif do == "play":
            self.playback.rate = min(max(number(request.get("rate", 1.0), MAX_RATE), 0.1), MAX_RATE)
            self.playback.playing = True
        elif do == "pause":
            self.playback.playing = False
        elif do == "what-if":
            changes = [change.strip() for change in str(request["changes"]).split(";") if change.strip()]
            for change in changes:
                if not SETTING.match(change):
                    raise UserError(f"{change}: expected table.key=value, separated by ;")
            if self._filtering is not None and not self._filtering.done():
                raise UserError("what-if: the last one is still being filtered")
            # In a task of its own: a disarm does not wait for it.
            self._filtering = asyncio.create_task(self._filter_again(self.playback, changes))
        elif do == "seek":
            self._show(self.playback.seek(number(request["t_s"], 1e9)))
        else:
            raise UserError(f"{do}: not understood")
        if self.playback is not None:
            self.tell(play=self.playback.state())

    async def _filter_again(self, playback: Playback, changes: list[str]) -> None:
        try:
            told = None
            if changes:
                told = await asyncio.to_thread(playback.filter_again, changes)
            else:
                playback.beside = None
            if self.playback is playback:
                self.tell(what_if=told)
                self._show(playback.seek(playback.t_s))
        except (UserError, OSError) as error:
            self.tell(error=str(error))

    def _show(self, history: list[bytes]) -> None:
        """One message, however many frames: it counts as one in the queue."""
        self.waiting = deque(item for item in self.waiting if isinstance(item, str))
        self.offer(b"".join([b"\0", *(len(f).to_bytes(4, "big") + f for f in history)]))

    async def _keep_playing(self) -> None:
        last_s = told_s = time.monotonic()
        while True:
            await asyncio.sleep(0.02)
            now_s = time.monotonic()
            if self.playback is not None:
                was_playing = self.playback.playing
                frame = self.playback.advance(now_s - last_s)
                if frame is not None:
                    self.offer(frame)
                if was_playing and (now_s - told_s > 0.2 or not self.playback.playing):
                    told_s = now_s
                    self.tell(play=self.playback.state())
            last_s = now_s

    def _release(self) -> None:
        if self.cockpit.in_control is self:
            self.cockpit.in_control = None
            self.cockpit.changed()

    def on_close(self) -> None:
        self.cockpit.pages.discard(self)
        self._release()
        for task in (self._sender, self._player, self._filtering):
            if task is not None:
                task.cancel()


def own_hosts(port: int) -> set[str]:
    return {f"127.0.0.1:{port}", f"localhost:{port}"}


class Files(tornado.web.RequestHandler):
    """The page, and what it needs of the installed packages; nothing else. No secret is in them."""

    def initialize(self, cockpit: Cockpit) -> None:
        self.cockpit = cockpit

    def set_default_headers(self) -> None:
        for name, value in SECURITY_HEADERS.items():
            self.set_header(name, value)
        self.clear_header("Server")

    def get(self, name: str) -> None:
        if self.request.host not in own_hosts(self.cockpit.port):
            self.cockpit.refused["host"] += 1
            raise tornado.web.HTTPError(403)
        name = name or "index.html"
        path = MODULES / LIBRARIES[name] if name in LIBRARIES else HERE / name
        if path.suffix not in TYPES or (name not in LIBRARIES and path.parent != HERE) or not path.is_file():
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", f"{TYPES[path.suffix]}; charset=utf-8")
        self.write(path.read_bytes())


def application(cockpit: Cockpit) -> tornado.web.Application:
    shared = {"cockpit": cockpit}
    return tornado.web.Application(
        [(r"/socket", Page, shared), (r"/([A-Za-z.]*)", Files, shared)],
        websocket_max_message_size=MAX_REQUEST,
        websocket_ping_interval=10,
        log_function=lambda handler: None,
    )
