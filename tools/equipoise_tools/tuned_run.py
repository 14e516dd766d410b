"""Runs of a choice of parameters: `equipoise design` says if it may run, `equipoise trials` runs it."""

from __future__ import annotations

import json
import math
import os
import subprocess
from pathlib import Path

from .paths import UserError

# Aimed at over yaw rates up to 3 Hz; a shipped design that has less keeps what it has.
PHASE_DEG = {"u": 40.0, "gyro": 40.0, "encoder": 35.0}
GAIN_DB = 6.0


class NotRun(Exception):
    """The design was refused, or misses a margin."""


class Runs:
    def __init__(
        self,
        program: Path,
        config: Path,
        runs: list[tuple[float, float]],
        duration_s: float,
        fidelity: str,
        folder: Path,
    ) -> None:
        self.program, self.config, self.runs, self.folder = program, config, runs, folder
        self._shipped: dict[str, tuple[float, float]] | None = None
        self.common = {"duration_s": duration_s, "fidelity": fidelity, "seed": 1}

    def _told(self, *words: object) -> subprocess.CompletedProcess[str]:
        command = [str(word) for word in (self.program, *words)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    @staticmethod
    def _set(settings: list[str]) -> list[str]:
        return [word for text in settings for word in ("--set", text)]

    def margins(self, settings: list[str]) -> dict[str, tuple[float, float]]:
        """Smallest phase and gain margin of each channel; NotRun when the design is refused."""
        done = self._told("design", "--config", self.config, *self._set(settings), "--json", "-")
        if done.returncode != 0:
            raise NotRun(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "design refused")
        found = {}
        rows = [row["margins"] for row in json.loads(done.stdout)["rows"] if row["yaw_hz"] <= 3.0]
        for channel in PHASE_DEG:
            phases = [row[channel]["phase_deg"] for row in rows]
            gains = [row[channel][gain] for row in rows for gain in ("gain_up_dB", "gain_down_dB")]
            found[channel] = (
                min((phase for phase in phases if phase is not None), default=math.inf),
                min((abs(gain) for gain in gains if gain is not None), default=math.inf),
            )
        return found

    def check_margins(self, settings: list[str]) -> None:
        """NotRun when a margin is below its aim and below the shipped design's."""
        if self._shipped is None:
            self._shipped = self.margins([])
        for channel, (phase_deg, gain_dB) in self.margins(settings).items():
            had_deg, had_dB = self._shipped[channel]
            if phase_deg < min(PHASE_DEG[channel], had_deg):
                raise NotRun(f"{phase_deg:.1f} degrees at {channel}")
            if gain_dB < min(GAIN_DB, had_dB):
                raise NotRun(f"{gain_dB:.1f} dB at {channel}")

    def run(self, robots: range, settings: list[str]) -> list[dict]:
        """Every robot at every point, in order."""
        trials = [
            {"robot": robot, "yaw_hz": yaw, "drive_mps": drive, **self.common}
            for robot in robots
            for yaw, drive in self.runs
        ]
        request = self.folder / "trials.json"
        request.write_text(json.dumps({"trials": trials}))
        jobs = os.cpu_count() or 1
        done = self._told(
            "trials", "--config", self.config, "--in", request, "--jobs", jobs, *self._set(settings)
        )
        if done.returncode != 0:
            raise UserError(done.stderr.strip() or f"equipoise trials ended with {done.returncode}")
        return json.loads(done.stdout)["trials"]
