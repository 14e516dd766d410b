"""Monte Carlo over robots, seeds and commands on Dask; see tools/campaign --help.

A chunk of trials is one call of `equipoise trials`; a finished chunk is one Parquet file, so that an
interrupted campaign goes on where it was.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .campaign_page import write_page
from .paths import UserError, binary, repository_root

RUNS = ("0,0.3", "0.5,0.3", "1,0.2", "1.5,0.2", "2,0.2", "3,0.2")


def identity(trial: dict) -> tuple:
    return trial["robot"], trial["seed"], float(trial["yaw_hz"]), float(trial["drive_mps"])


SEEDS_APART = 1_000_000
WORLDS = ("ideal", "thesis", "nominal", "full", "built2025")


def plan(robots: range, seeds: int, runs: list[tuple[float, float]], settings: dict) -> list[dict]:
    """Every trial, one robot after the other, so that a part of the list is a smaller campaign.

    Robots do not share seeds: a start and a noise of one's own each.
    """
    common = {
        key: settings[key] for key in ("duration_s", "fidelity", "estimator", "controller") if settings[key]
    }
    if settings["engine"] == "mujoco":
        common["floor"] = settings["floor"]
    return [
        {"robot": robot, "seed": robot + SEEDS_APART * k, "yaw_hz": yaw, "drive_mps": drive, **common}
        for robot in robots
        for k in range(seeds)
        for yaw, drive in runs
    ]


def run_chunk(program: str, settings: dict, trials: list[dict]) -> list[dict]:
    """On a worker: one process, one core."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        request = Path(folder) / "trials.json"
        request.write_text(json.dumps({"trials": trials}))
        engine = [program, "trials", "--jobs", "1"]
        if settings["engine"] == "mujoco":
            engine = [sys.executable, "-m", "equipoise_tools.mujoco_engine"]
        command = [*engine, "--config", settings["config_path"], "--in", request]
        for text in settings["set"]:
            command += ["--set", text]
        command += ["--twins"] if settings["twins"] else []
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(done.stderr.strip() or f"{command[0]} ended with {done.returncode}")
    return json.loads(done.stdout)["trials"]


def write_part(rows: list[dict], path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    flat = []
    for row in rows:
        values = {key: value for key, value in row.items() if key != "drawn"}
        flat.append({**values, **{f"drawn.{name}": value for name, value in row["drawn"].items()}})
    unfinished = path.with_suffix(".part")
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(flat), unfinished)
    unfinished.rename(path)


def read_parts(folder: Path) -> list[dict]:
    import pyarrow.parquet

    rows = []
    for path in sorted(folder.glob("trials-*.parquet")):
        for flat in pyarrow.parquet.read_table(path).to_pylist():
            row = {key: value for key, value in flat.items() if not key.startswith("drawn.")}
            row["drawn"] = {
                key[6:]: v for key, v in flat.items() if key.startswith("drawn.") and v is not None
            }
            rows.append(row)
    return rows


def open_folder(out: Path, settings: dict) -> None:
    """The folder is new, or holds the beginning of this very campaign."""
    out.mkdir(parents=True, exist_ok=True)
    about = out / "campaign.json"
    if about.exists() and json.loads(about.read_text()) != settings:
        raise UserError(f"{out}: holds another campaign (campaign.json); give another --out or remove it")
    about.write_text(json.dumps(settings, indent=2) + "\n")


class Progress:
    def __init__(self, total: int, done: int) -> None:
        self.total, self.done, self.fell, self.at_start = total, done, 0, done
        self.started, self.shown = time.monotonic(), 0.0

    def add(self, rows: list[dict]) -> None:
        self.done += len(rows)
        self.fell += sum(row["fell"] for row in rows)
        now = time.monotonic()
        if now - self.shown < (0.2 if sys.stderr.isatty() else 30.0) and self.done < self.total:
            return
        self.shown = now
        rate = (self.done - self.at_start) / max(now - self.started, 1e-9)
        bar = "#" * (30 * self.done // self.total)
        left_s = (self.total - self.done) / max(rate, 1e-9)
        end = "\r" if sys.stderr.isatty() and self.done < self.total else "\n"
        print(
            f"[{bar:30s}] {self.done}/{self.total}, {self.fell} fell, {rate:.1f}/s, {left_s:.0f} s left ",
            end=end,
            file=sys.stderr,
            flush=True,
        )


def run_missing(missing: list[dict], settings: dict, given: argparse.Namespace, progress: Progress) -> None:
    from dask.distributed import Client, LocalCluster, as_completed

    chunks = [missing[i : i + given.chunk] for i in range(0, len(missing), given.chunk)]
    workers = given.workers or os.cpu_count() or 1
    cluster = None
    if given.scheduler:
        client = Client(given.scheduler)
    else:  # a worker waits for a process of its own: threads will do
        cluster = LocalCluster(
            n_workers=1,
            threads_per_worker=workers,
            processes=False,
            dashboard_address=None,
            protocol="inproc://",
        )
        client = Client(cluster)
    try:
        futures = client.map(lambda chunk: run_chunk(str(binary()), settings, chunk), chunks, pure=False)
        for _, rows in as_completed(futures, with_results=True):
            name = hashlib.sha256(json.dumps([identity(row) for row in rows]).encode()).hexdigest()[:16]
            write_part(rows, given.out / f"trials-{name}.parquet")
            progress.add(rows)
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


def pair(text: str) -> tuple[float, float]:
    try:
        yaw, drive = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: expected YAW_HZ,M_S such as 1,0.2") from None
    return yaw, drive


def arguments(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/campaign", description=__doc__.splitlines()[0])
    parser.add_argument("--config", default="config/mbbr.toml")
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument(
        "--first-robot", type=int, default=1, help="others are held out of a tuning that used 1 to N"
    )
    parser.add_argument("--runs", nargs="+", type=pair, default=[pair(run) for run in RUNS])
    parser.add_argument("--seeds", type=int, default=1, help="runs of each robot at each point")
    parser.add_argument("--duration-s", type=float, default=60.0)
    parser.add_argument(
        "--engine", choices=("own", "mujoco"), default="own", help="whose rigid bodies and contacts"
    )
    parser.add_argument(
        "--floor",
        choices=("calm", "disturbed"),
        default="calm",
        help="of mujoco: level and untouched, or sloped, with sills of 1 to 2 mm and pushes of 1 to 4 N",
    )
    parser.add_argument("--fidelity", default="full", choices=WORLDS)
    parser.add_argument("--estimator", default="")
    parser.add_argument("--controller", default="")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument(
        "--twins", action="store_true", help="each trial again with nothing judged: twice as long"
    )
    parser.add_argument("--scheduler", help="address of an existing Dask scheduler, e.g. tcp://10.0.0.5:8786")
    parser.add_argument("--workers", type=int, default=0, help="0: one per core")
    parser.add_argument("--chunk", type=int, default=12, help="trials per piece of work")
    parser.add_argument("--out", type=Path, default=repository_root() / "build" / "campaign")
    given = parser.parse_args(words)
    if given.engine == "own" and given.floor != "calm":
        parser.error("--floor is mujoco's; of the own engine it is a key of [world.*], docs/disturbances.md")
    if min(given.robots, given.seeds, given.chunk) < 1 or given.first_robot < 0:
        parser.error("--robots, --seeds and --chunk must be 1 or more, --first-robot 0 or more")
    return given


def settings_of(given: argparse.Namespace) -> dict:
    path = Path(given.config)
    path = path if path.exists() else repository_root() / given.config
    if not path.exists():
        raise UserError(f"{given.config}: cannot be opened")
    version = subprocess.run(
        [binary(), "--version"], capture_output=True, text=True, check=False
    ).stdout.strip()
    return {
        "config": given.config,
        "config_path": str(path.resolve()),
        "config_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "version": version,
        "fidelity": given.fidelity,
        "duration_s": given.duration_s,
        "estimator": given.estimator,
        "controller": given.controller,
        "set": given.set,
        "engine": given.engine,
        "floor": given.floor,
        "twins": given.twins,
    }


def main(words: list[str] | None = None) -> int:
    given = arguments(words)
    try:
        settings = settings_of(given)
        open_folder(given.out, settings)
        robots = range(given.first_robot, given.first_robot + given.robots)
        wanted = plan(robots, given.seeds, given.runs, settings)
        done = {identity(row) for row in read_parts(given.out)}
        missing = [trial for trial in wanted if identity(trial) not in done]
        if missing:
            run_missing(missing, settings, given, Progress(len(wanted), len(wanted) - len(missing)))
        chosen = {identity(trial) for trial in wanted}
        rows = sorted((row for row in read_parts(given.out) if identity(row) in chosen), key=identity)
        print(write_page(rows, settings, given.out))
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\ninterrupted; the same command goes on from here", file=sys.stderr)
        return 1
    return 0 if len(rows) == len(wanted) else 1


if __name__ == "__main__":
    sys.exit(main())
