"""Flights of a choice of parameters: `equipoise design` says if it may fly, `equipoise trials` flies it."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from .paths import UserError

# What docs/as-built.md and `equipoise design` ask for, over the whole table of yaw rates.
MARGINS = {"u": 40.0, "gyro": 40.0, "encoder": 35.0, "gain_dB": 6.0}


class NotFlown(Exception):
    """The design was refused, or misses a margin."""


class Flights:
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
        self.common = {"duration_s": duration_s, "fidelity": fidelity, "seed": 1}

    def _told(self, *words: object) -> subprocess.CompletedProcess[str]:
        command = [str(word) for word in (self.program, *words)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    @staticmethod
    def _set(settings: list[str]) -> list[str]:
        return [word for text in settings for word in ("--set", text)]

    def check_margins(self, settings: list[str]) -> None:
        done = self._told("design", "--config", self.config, *self._set(settings), "--json", "-")
        if done.returncode != 0:
            raise NotFlown(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "design refused")
        for row in json.loads(done.stdout)["rows"]:
            if row["yaw_hz"] > 3.0:
                continue
            for channel, margin in row["margins"].items():
                if margin["phase_deg"] is not None and margin["phase_deg"] < MARGINS[channel]:
                    raise NotFlown(f"{margin['phase_deg']:.0f} degrees at {channel}, {row['yaw_hz']} Hz")
                gains = (margin["gain_up_dB"], margin["gain_down_dB"])
                if any(gain is not None and abs(gain) < MARGINS["gain_dB"] for gain in gains):
                    raise NotFlown(f"less than {MARGINS['gain_dB']:g} dB at {channel}, {row['yaw_hz']} Hz")

    def fly(self, robots: range, settings: list[str]) -> list[dict]:
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
