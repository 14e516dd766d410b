"""A foreign table by its map (docs/reality.md) as motion of a robot's planar model, on a grid of 5 ms."""

from __future__ import annotations

import json
import subprocess
import tomllib
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from .paths import UserError, binary
from .planar_model import STEP_S, Motion

UNITS = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "rad": 1.0, "deg": np.pi / 180, "rev": 2 * np.pi,
    "rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30, "rev/s": 2 * np.pi,
    "V": 1.0, "mV": 1e-3, "1": 1.0, "%": 0.01,
}  # fmt: skip


def configuration(path: Path, settings: list[str] | None = None) -> dict[str, dict[str, Any]]:
    """The tables in force, as the firmware reads them."""
    command = [str(binary()), "config", "show", "--config", str(path), "--json", "-"]
    for setting in settings or []:
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(done.stderr.strip().removeprefix("error: "))
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


def read_table(path: Path, shape: dict[str, Any]) -> pd.DataFrame:
    names = shape.get("columns")
    if path.exists() and not path.is_file():
        raise UserError(f"{path}: is no file")  # a pipe might never end
    try:
        if shape.get("format") == "float32":
            if not names:
                raise UserError(f"{path}: a float32 table needs table.columns in the map")
            values = np.frombuffer(path.read_bytes()[shape.get("header_bytes", 0) :], "<f4")
            return pd.DataFrame(
                values[: len(values) // len(names) * len(names)].reshape(-1, len(names)), columns=names
            )
        lines = [
            x
            for x in path.read_text("utf-8-sig").splitlines()
            if x.strip() and not x.lstrip().startswith(("%", "#"))
        ]
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {error}") from None
    if not lines:
        raise UserError(f"{path}: holds no row")
    separator = next((s for s in ",;\t" if s in lines[0]), r"\s+")
    table = pd.read_csv(StringIO("\n".join(lines)), sep=separator, names=names, header=None if names else 0)
    return table.apply(pd.to_numeric, errors="coerce")


class Columns:
    """Columns of the map by name, "-name" flipped, in SI; rows whose time does not advance are dropped."""

    def __init__(self, table: pd.DataFrame, time: dict[str, Any]):
        self.table = table
        scale = time.get("scale", UNITS.get(time.get("unit", "s"), 1.0))
        if "rate_hz" in time:
            t = np.arange(len(table)) / time["rate_hz"]
        elif "step" in time:
            t = np.cumsum(self.named(time["step"])) * scale
        else:
            t = self.named(time["column"]) * scale
        newest = np.maximum.accumulate(np.where(np.isfinite(t), t, -np.inf))
        self.rows = np.flatnonzero((np.diff(newest, prepend=-np.inf) > 0) & np.isfinite(t))
        self.t = t[self.rows] - (t[self.rows[0]] if "step" in time else 0.0)

    def named(self, name: str) -> np.ndarray:
        sign, name = (-1.0, name[1:]) if name.startswith("-") else (1.0, name)
        if name not in self.table:
            raise UserError(
                f"the table has no column {name}; it has {', '.join(map(str, self.table.columns))}"
            )
        return sign * self.table[name].to_numpy(float)

    def channel(self, section: dict[str, Any], names: list[str]) -> np.ndarray:
        scale = section.get("scale") or UNITS.get(section.get("unit", "1"))
        if scale is None:
            raise UserError(f"the unit {section['unit']} is none of {', '.join(UNITS)}")
        return scale * np.array([self.named(name)[self.rows] for name in names])


def motion(table: Path, map_file: Path) -> tuple[Motion, dict[str, dict[str, Any]], np.ndarray]:
    """Motion, the robot's configuration, and the grid's times."""
    try:
        described = tomllib.loads(map_file.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise UserError(f"{map_file}: {error}") from None
    for section, wants in (
        ("tilt", "the robot's own tilt"),
        ("wheels", "the wheels"),
        ("drive", "the motors' input"),
    ):
        if section not in described:
            raise UserError(f"{map_file}: no [{section}]; identification wants {wants}")
    config = configuration(map_file.parent / described["robot"])
    columns = Columns(read_table(table, described.get("table", {})), described["time"])
    t = columns.t
    grid = np.arange(t[0], t[-1], STEP_S)

    def linear(rows: np.ndarray) -> np.ndarray:
        return np.array([np.interp(grid, t[np.isfinite(r)], r[np.isfinite(r)]) for r in rows])

    tilt_names = described["tilt"].get("axes") or [described["tilt"]["column"]]
    theta = linear(columns.channel(described["tilt"], tilt_names))
    wheels = columns.channel(described["wheels"], described["wheels"]["axes"])
    if described["wheels"]["kind"] == "rate":
        wheels = np.cumsum(wheels * np.diff(t, prepend=t[0]), axis=1)
    drive = columns.channel(described["drive"], described["drive"]["axes"])
    nominal = config["motor"]["nominal_V"]
    if described["drive"]["kind"] == "volts":
        drive = drive / nominal
    elif described["drive"]["kind"] == "duty":
        battery = described.get("battery", {})
        supply = (
            columns.channel(battery, [battery["column"]])[0]
            if "column" in battery
            else battery.get("volts", nominal)
        )
        drive = drive * supply / nominal
    else:
        raise UserError(
            f"{map_file}: identification takes drive.kind volts or duty, not {described['drive']['kind']}"
        )
    held = np.nan_to_num(drive[:, np.searchsorted(t, grid + 1e-9, side="right") - 1])
    wheels = linear(wheels)
    if config["robot"]["type"] == "mbbr":
        ratio = config["robot"]["ball_radius_m"] / config["robot"]["wheel_radius_m"]
        axes = np.array(geometry(config["robot"])["T_ob"])
        phi, u = (np.linalg.inv(axes.T) @ wheels / ratio)[:2], (ratio * axes @ held)[:2]
    else:
        phi, u = wheels.mean(axis=0, keepdims=True), held.mean(axis=0, keepdims=True)
    if len(theta) != len(phi):
        raise UserError(
            f"{map_file}: tilt.axes names {len(theta)} columns; this robot balances about {len(phi)} axes"
        )
    stretches = described.get("balancing", [{"from_s": t[0], "to_s": t[-1]}])
    used = np.any([(grid >= s["from_s"]) & (grid < s["to_s"]) for s in stretches], axis=0)
    return Motion(theta, phi, u, used), config, grid
