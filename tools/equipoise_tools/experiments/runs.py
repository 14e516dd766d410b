"""Runs the equipoise binary for an experiment: JSON out, and logs in a scratch folder."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from pathlib import Path

from .. import metrics, names
from ..log import Log, read_log
from ..paths import UserError, repository_root


def binary() -> Path:
    path = Path(os.environ.get("EQUIPOISE_BINARY", repository_root() / "build" / "host" / "equipoise"))
    if not path.exists():
        raise UserError(f"{path}: not built; run tools/experiments, or cmake --build build/host")
    return path


def equipoise(*arguments: object, fails: bool = False) -> str:
    """Standard output. A failed job (exit status 1) is an error unless `fails`: a robot may fall."""
    command = [str(binary()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=repository_root(), check=False)
    if done.returncode not in ((0, 1) if fails else (0,)):
        raise UserError(f"{' '.join(command)}: {done.stderr.strip() or done.returncode}")
    return done.stdout


def equipoise_json(*arguments: object) -> dict:
    return json.loads(equipoise(*arguments, "--json", "-"))


def _sim(log: Path, config: str, sets: dict[str, object] | None, options: dict) -> dict:
    arguments: list[object] = ["sim", "--config", config, "--telemetry", "off", "--json", "-", "--log", log]
    for key, value in options.items():
        flag = "--" + key.replace("_", "-")
        arguments += [flag] if value is True else [flag, value]
    for key, value in (sets or {}).items():
        arguments += ["--set", f"{key}={value}"]
    return json.loads(equipoise(*arguments, fails=True))


def summarise(config: str = "config/mbbr.toml", sets: dict[str, object] | None = None, **options) -> dict:
    """Summary of a run; options become --yaw-hz and so on, `compare=True` a flag, `sets` --set."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        return _sim(Path(folder) / "run.lcm", config, sets, options)


def simulate(
    config: str = "config/mbbr.toml", sets: dict[str, object] | None = None, **options
) -> tuple[dict, Log]:
    """(summary, log) of such a run."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        log = Path(folder) / "run.lcm"
        summary = _sim(log, config, sets, options)
        return summary, read_log(log)


def over_estimate(log: Log, channel: str) -> float:
    """Slope of the estimated ball rate on the true one, both axes, after the run has settled."""
    estimate, truth = metrics.aligned(log, channel, names.TRUTH)
    settled = (estimate["utime"] - log.start_utime) * 1e-6 >= metrics.SETTLE_S
    x = metrics.rolling_rates(truth, 2)[settled].ravel()
    y = metrics.rolling_rates(estimate, 2)[settled].ravel()
    return float(x @ y / (x @ x))
