"""Runs, filters, figures: a row per run and filter."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import drawn
from .filters import FILTERS
from .judge import figures, rms
from .model import DT, GROUPS
from .recorded import Recording, Samples, record, run_filter, samples_of

WRONG_START_RAD = (0.1, -0.1)
WRONG_START_TICKS = int(3.0 / DT)
TIMED_TICKS = 300
DRAWN_CASES, DRAWN_TICKS = (0.0, 1.0), 3000  # Hz; 15 s

Row = dict[str, float | str]


def _of_one(samples: Samples) -> Samples:
    """The first run alone."""
    many = {k: v[..., :1] for k, v in vars(samples).items() if isinstance(v, np.ndarray) and k != "t_s"}
    return Samples(**{**vars(samples), **many})


def rows_of(samples: Samples, about: Sequence[dict[str, float | str]], recorded: bool) -> list[Row]:
    """Of every filter; recorded: the firmware was on the same samples."""
    radius_m = samples.robot.value("r")
    rows: list[Row] = []
    for kind in FILTERS:
        estimates = run_filter(kind, samples)
        found = figures(estimates, samples, radius_m)
        wrong = run_filter(kind, samples, WRONG_START_TICKS, WRONG_START_RAD) if recorded else None
        single, batch = (run_filter(kind, s, TIMED_TICKS).seconds for s in (_of_one(samples), samples))
        for i, whose in enumerate(about):
            row: Row = {**whose, "filter": kind.name}
            row["attitude_rmse_rad"] = found.attitude_rad[i]
            row["speed_rmse_m_s"] = found.speed_m_s[i]
            row["heading_error_rad"] = found.heading_rad[i]
            for name in GROUPS:
                row[f"nis_{name}"] = found.nis[name][i]
            for name in GROUPS:
                row[f"lag1_{name}"] = found.lag[name][i]
            for name in GROUPS:
                row[f"coloured_{name}"] = found.colour[name][i]
            row["wrong_start_rmse_rad"] = row["from_firmware_rad"] = row["from_firmware_m_s"] = np.nan
            if wrong is not None:
                missed = wrong.five[:, :2] - samples.truth[:WRONG_START_TICKS, :2]
                row["wrong_start_rmse_rad"] = rms(missed)[i]
                apart = np.abs(estimates.five - samples.own)[..., i].max(axis=0)
                row["from_firmware_rad"] = apart[:2].max()
                row["from_firmware_m_s"] = radius_m * apart[2:4].max()
            row["single_us_per_tick"] = 1e6 * single / TIMED_TICKS
            row["batch_us_per_tick"] = 1e6 * batch / TIMED_TICKS / len(about)
            rows.append(row)
    return rows


def measure(
    numbers: Iterable[int], cases: Iterable[tuple[float, float]], duration_s: float, seed: int
) -> list[Row]:
    runs: list[Recording] = []
    for number in numbers:
        for yaw_hz, drive_mps in cases:
            run = record(number, yaw_hz, drive_mps, duration_s, seed, fidelity="built2025")
            if run.ended == "finished":
                runs.append(run)
            else:
                print(f"robot {number} at {yaw_hz} Hz, {drive_mps} m/s: {run.ended}; left out")
    about = [
        {"world": "full", "robot_number": f.robot_number, "yaw_hz": f.yaw_hz, "drive_mps": f.drive_mps}
        for f in runs
    ]
    samples = samples_of(runs)
    rows = rows_of(samples, about, recorded=True)
    count = len({f.robot_number for f in runs})
    for yaw_hz in DRAWN_CASES:
        of = {"world": "drawn", "yaw_hz": yaw_hz, "drive_mps": 0.0}
        about = [{**of, "robot_number": i + 1} for i in range(count)]
        rows += rows_of(drawn.draw(samples.robot, count, DRAWN_TICKS, yaw_hz, seed), about, recorded=False)
    return rows


def write(path: Path, rows: list[Row]) -> None:
    table = pa.Table.from_pylist(rows)
    numbers = [f.name for f in table.schema if pa.types.is_floating(f.type)]
    words = [f.name for f in table.schema if pa.types.is_string(f.type)]
    packing = {"use_dictionary": words, "use_byte_stream_split": numbers}
    pq.write_table(table, path, compression="zstd", compression_level=19, **packing)


def read(path: Path) -> list[Row]:
    return pq.read_table(path).to_pylist()
