"""Logs as a LeRobotDataset v3.0, to learn a policy from; `equipoise convert LOG --to lerobot`.

An episode is a stretch of ticks without a gap in which the motors ran, a frame is a tick. The action is what
was written to the motors, decided from that frame's observations. Axes are the firmware's (docs/symbols.md).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import channels as ch
from ._convert import convert
from ._data import need
from .errors import UserError
from .log import Log

Array = NDArray[Any]
ARMED = 1  # enum ArmState
TICK_HZ = 200
TASK = "balance and follow the command"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
STATE = {"theta_rad": "xyz", "omega_B_rad_s": "xyz", "phi_dot_rad_s": "xy", "position_W_m": "xy"}
INDICES = ("frame_index", "episode_index", "index", "task_index")


def _features(log: Log) -> dict[str, tuple[list[str], Array]]:
    """Names of components, and a row for every tick that has all of them and whose motors ran; `tick`."""
    sources = (ch.SENSORS, ch.COMMAND, ch.STATE, ch.REFERENCE, ch.MOTORS, ch.HEALTH)
    if lacking := [channel for channel in sources if channel not in log]:
        raise UserError(f"{log.path}: has no {', '.join(lacking)}")
    health, motors = log[ch.HEALTH], log[ch.MOTORS]
    kept = [log[channel]["tick"] for channel in sources]
    kept += [health["tick"][health["arm_state"] == ARMED], motors["tick"][motors["enable"] != 0]]
    tick = reduce(np.intersect1d, kept)

    def rows(channel: str) -> Array:
        return log[channel][np.searchsorted(log[channel]["tick"], tick)]

    z = log.sensors()[np.searchsorted(log[ch.SENSORS]["tick"], tick)]
    wheels = range(z["wheel_angle_rad"].shape[1])
    sensors = {"gyro_B_rad_s": "xyz", "accel_B_m_s2": "xyz", "wheel_angle_rad": wheels, "battery_V": ""}
    command = {"velocity_W_m_s": "xy", "yaw_rate_rad_s": ""}
    found: dict[str, tuple[list[str], Array]] = {"tick": ([], tick)}
    for key, records, quantities in (
        ("observation.sensors", z, sensors),
        ("observation.state", rows(ch.STATE), STATE),
        ("observation.reference", rows(ch.REFERENCE), STATE),
        ("observation.command", rows(ch.COMMAND), command),
    ):
        names = [n for q, parts in quantities.items() for n in ([f"{q}.{p}" for p in parts] or [q])]
        values = np.column_stack([records[q] for q in quantities]) if len(tick) else np.empty((0, len(names)))
        found[key] = names, values.astype(np.float32)
    count = int(motors["motors"][0]) if len(motors) else 0
    if not 1 <= count <= motors["duty"].shape[1]:
        raise UserError(f"{log.path}: says that it has {count} motors")
    found["action"] = [f"duty.{i}" for i in range(count)], rows(ch.MOTORS)["duty"][:, :count].astype(
        np.float32
    )
    return found


def _statistics(values: Array) -> dict[str, list[Any]]:
    values = values.reshape(len(values), -1).astype(float)
    found = {name: getattr(values, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    quantiles = {f"q{q:02d}": np.percentile(values, q, axis=0).tolist() for q in (1, 10, 50, 90, 99)}
    return {**found, **quantiles, "count": [len(values)]}


def _episodes(log: Log, read: dict[str, tuple[list[str], Array]]) -> list[dict[str, Array]]:
    tick = read["tick"][1]
    if not len(tick):
        raise UserError(f"{log.path}: its motors never ran; nothing to learn from")
    starts = np.flatnonzero(np.diff(tick) != 1) + 1
    columns = {key: np.split(values, starts) for key, (_, values) in read.items() if key != "tick"}
    return [dict(zip(columns, parts, strict=True)) for parts in zip(*columns.values(), strict=True)]


def write(logs: Log | Sequence[Log], folder: str | Path) -> dict[str, int]:
    """Makes the folder; how many episodes and frames it has."""
    need("pandas", "lerobot")
    pa, parquet = need("pyarrow", "lerobot"), need("pyarrow.parquet", "lerobot")
    import pandas  # type: ignore[import-untyped]

    logs, root = [logs] if isinstance(logs, Log) else logs, Path(folder)
    if root.exists():
        raise UserError(f"{folder}: exists; choose another --out or remove it")
    reads = [_features(log) for log in logs]
    robot = logs[0].run.robot
    names = {key: names for key, (names, _) in reads[0].items() if key != "tick"}
    if any(log.run.robot != robot for log in logs):
        raise UserError("a dataset is of one robot; these logs are of several")
    episodes = [e for log, read in zip(logs, reads, strict=True) for e in _episodes(log, read)]
    lengths = [len(e["action"]) for e in episodes]
    ends = np.cumsum(lengths)
    for i, (episode, length) in enumerate(zip(episodes, lengths, strict=True)):
        frame = np.arange(length)
        of_all = frame, np.full(length, i), frame + ends[i] - length, np.zeros(length, int)
        episode.update(
            {"timestamp": (frame / TICK_HZ).astype(np.float32)}, **dict(zip(INDICES, of_all, strict=True))
        )

    def put(table: Any, name: str) -> None:
        path = root / name.format(chunk_index=0, file_index=0)
        path.parent.mkdir(parents=True)
        parquet.write_table(table, path)

    columns = {}
    for key in episodes[0]:
        values = np.concatenate([e[key] for e in episodes])
        flat = pa.array(values.ravel())
        columns[key] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    put(pa.table(columns), f"data/{FILE}")
    about = {
        "episode_index": list(range(len(episodes))),
        "tasks": [[TASK]] * len(episodes),
        "length": lengths,
        "dataset_from_index": (ends - lengths).tolist(),
        "dataset_to_index": ends.tolist(),
    }
    for kind in ("data", "meta/episodes"):
        about |= {f"{kind}/{part}_index": [0] * len(episodes) for part in ("chunk", "file")}
    each = [{key: _statistics(values) for key, values in e.items()} for e in episodes]
    about |= {f"stats/{k}/{s}": [one[k][s] for one in each] for k in each[0] for s in each[0][k]}
    put(pa.table(about), f"meta/episodes/{FILE}")
    pandas.DataFrame({"task_index": [0]}, index=[TASK]).to_parquet(root / "meta/tasks.parquet")
    every = {key: np.concatenate([e[key] for e in episodes]) for key in episodes[0]}
    (root / "meta/stats.json").write_text(json.dumps({k: _statistics(v) for k, v in every.items()}))
    features = {
        key: {"dtype": str(values.dtype), "shape": [*values.shape[1:]] or [1], "names": names.get(key)}
        for key, values in every.items()
    }
    frames = int(ends[-1])
    info = {
        "codebase_version": "v3.0",
        "robot_type": f"equipoise_{robot}",
        "total_episodes": len(episodes),
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": TICK_HZ,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{FILE}",
        "video_path": None,
        "features": features,
    }
    (root / "meta/info.json").write_text(json.dumps(info, indent=2))
    return {"episodes": len(episodes), "frames": frames}


def main(arguments: list[str] | None = None) -> int:
    return convert("lerobot", __doc__, write, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
