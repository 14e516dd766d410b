"""A foreign table by its map (docs/reality.md) as motion of a robot's planar model, on a grid of 5 ms."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from .paths import UserError, binary
from .planar_model import STEP_S, Motion


def configuration(path: Path, settings: list[str] | None = None) -> dict[str, dict[str, Any]]:
    """The tables in force, as the firmware reads them."""
    command = [str(binary()), "config", "show", "--config", str(path), "--json", "-"]
    for setting in settings or []:
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(done.stderr.strip().removeprefix("equipoise: "))
    tables: dict[str, dict[str, Any]] = {}
    for name, value in json.loads(done.stdout).items():
        table, _, key = name.rpartition(".")
        tables.setdefault(table, {})[key] = value
    return tables


def geometry(robot: dict[str, Any], axes: np.ndarray | None = None) -> dict[str, Any]:
    """Of a ball-bot's [robot], as the firmware has it; with measured axes also how they differ."""
    command = [str(binary()), "geometry", "--json", "-"]
    command += ["--alpha-deg", str(robot["wheel_latitude_deg"])]
    command += ["--azimuth-deg", str(robot["wheel_azimuth_deg"])]
    if robot.get("wheel_tilt_deg", "orthogonal") != "orthogonal":
        command += ["--tilt-deg", str(robot["wheel_tilt_deg"])]
    if axes is not None:
        command += ["--axes", *(f"{value:.9g}" for value in axes.T.ravel())]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def motion(table: Path, map_file: Path) -> tuple[Motion, dict[str, dict[str, Any]], np.ndarray]:
    """Motion, the robot's configuration, and the grid's times."""
    command = [str(binary()), "import", str(table), "--map", str(map_file), "--motion", "-"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(done.stderr.strip().removeprefix("equipoise: "))
    rows = json.loads(done.stdout)
    t = np.array(rows["t_s"])
    grid = np.arange(t[0], t[-1], STEP_S)

    def columns(name: str) -> list[np.ndarray]:
        return [np.array(axis[name], float) for axis in rows["axes"]]

    def linear(name: str) -> np.ndarray:
        return np.array([np.interp(grid, t[np.isfinite(x)], x[np.isfinite(x)]) for x in columns(name)])

    held = np.searchsorted(t, grid + 1e-9, side="right") - 1
    drive = np.array([np.nan_to_num(x)[held] for x in columns("drive")])
    stretches = rows["balancing_s"] or [[t[0], t[-1]]]
    used = np.any([(grid >= start) & (grid < end) for start, end in stretches], axis=0)
    log = Motion(linear("tilt_rad"), linear("rolling_rad"), drive, used)
    return log, configuration(Path(rows["config"])), grid
