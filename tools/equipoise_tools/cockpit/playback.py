"""A log played to one page: seek, play at a rate, pause. Frames as they were live."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from equipoise_robot.log import Log, read_log

from .. import names
from ..metrics import number_rows, outcome, robot_of, safety_events, summarise
from ..paths import UserError
from ..what_if import NOTE, what_if
from .frames import CHANNELS, HISTORY, PLAYED, WHAT_IF, pack

HISTORY_S = 30.0
HISTORY_FRAMES = 1500
MAX_RATE = 16.0


class Playback:
    def __init__(self, path: Path) -> None:
        self.log: Log = read_log(path)
        if names.STATE not in self.log:
            raise UserError(f"{path.name}: no channel {names.STATE}: not the log of a run")
        self.channels = [c for c in CHANNELS if c in self.log and self.log[c].dtype.names]
        self._ticks = {channel: self.log[channel]["tick"] for channel in self.channels}
        self._t_s = self.log.seconds(names.STATE)
        self.first_s, self.last_s = float(self._t_s[0]), float(self._t_s[-1])
        self.t_s = self.first_s
        self.rate = 1.0
        self.playing = False
        self._shown = -1
        self.beside: Playback | None = None  # what another tuning would have made of it

    def filter_again(self, changes: list[str]) -> dict:
        """Shows another tuning beside the run from now on; the numbers of both."""
        with TemporaryDirectory(prefix="equipoise-what-if-") as folder:
            path, note = what_if(self.log.path, changes, Path(folder))
            beside = Playback(path)
        was, then = (dict(number_rows(summarise(playback.log))) for playback in (self, beside))
        self.beside = beside
        return {
            "set": changes,
            "rows": [
                [what, was.get(what, "-"), then.get(what, "-")] for what in dict.fromkeys([*was, *then])
            ],
            "note": " ".join([NOTE, note]).strip(),
        }

    def describe(self) -> dict:
        summary = summarise(self.log)
        run = self.log[names.RUN][0] if names.RUN in self.log else None
        return {
            "name": self.log.path.name,
            "first_s": self.first_s,
            "last_s": self.last_s,
            "robot": robot_of(self.log),
            "outcome": outcome(summary),
            "estimator": run.estimator if run else None,
            "controller": run.controller if run else None,
            "notes": self.log.notes[:5],
            "events": safety_events(self.log)[:200],
        }

    def state(self) -> dict:
        return {"t_s": self.t_s, "playing": self.playing, "rate": self.rate}

    def seek(self, t_s: float) -> list[bytes]:
        """What a page needs to draw that moment and the plots before it."""
        self.t_s = min(max(t_s, self.first_s), self.last_s)
        last = self._index()
        first = max(0, int(np.searchsorted(self._t_s, self.t_s - HISTORY_S)))
        step = max(1, -(-(last - first) // HISTORY_FRAMES))
        frames = [self._frame(i, HISTORY) for i in range(first + (last - first) % step, last, step)]
        self._shown = last
        return [*frames, self._frame(last, PLAYED)]

    def advance(self, elapsed_s: float) -> bytes | None:
        """The next frame to draw, or None when there is no new one."""
        if not self.playing:
            return None
        self.t_s = min(self.t_s + self.rate * elapsed_s, self.last_s)
        self.playing = self.t_s < self.last_s
        if (i := self._index()) == self._shown:
            return None
        self._shown = i
        return self._frame(i, PLAYED)

    def _index(self) -> int:
        return max(0, int(np.searchsorted(self._t_s, self.t_s + 1e-9, side="right")) - 1)

    def _frame(self, i: int, kind: int) -> bytes:
        tick = self._ticks[names.STATE][i]
        messages = {channel: self._message(channel, tick) for channel in self.channels}
        if self.beside is not None:
            for channel in set(WHAT_IF) & set(self.beside.channels):
                messages[WHAT_IF[channel]] = self.beside._message(channel, tick)
        return pack(kind, 0.0, {channel: body for channel, body in messages.items() if body})

    def _message(self, channel: str, tick: int) -> bytes:
        """Of that tick, of a histogram the newest until then; empty: there is none."""
        j = int(np.searchsorted(self._ticks[channel], tick, side="right")) - 1
        if j < 0 or (channel != names.TIMING_HISTOGRAM and self._ticks[channel][j] != tick):
            return b""
        record = self.log[channel][j : j + 1]
        return record.astype(record.dtype.newbyteorder(">")).tobytes()
