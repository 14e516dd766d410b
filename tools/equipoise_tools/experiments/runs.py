"""Runs the equipoise binary for an experiment: JSON out, logs in a scratch folder, many runs on all cores."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from equipoise_robot.log import Log, read_log

from .. import metrics, names, published
from ..paths import UserError, binary, repository_root
from .data import Data, Ran, thinned

MBBR, MIP = "config/mbbr.toml", "config/edumip.toml"
BUILT = "built2025"  # the world of a typical built robot in which these were measured; `full` moves on
# [T]'s robot had none of our gates: only the tilt ends a run (limits at the ends of their ranges).
NO_GATES = {
    "safety.max_innovation_published": 1000,
    "safety.max_innovation": 1000,
    "safety.encoder_check_drive": 0,
    "safety.encoder_probe_drive": 0,
}
LOSSLESS = {"motor.bridge_lost_s": 0}  # the bridges of built2025 lose nothing
AS_PUBLISHED = published.control()
# [T] computes in double precision: no difference to it comes from rounding.
PRECISION = {"estimator.ekf.precision": "double"}


# Filters that take an attitude from the simulated packets: its error is put in.
PACKETS = "attitude packets' noise of 0.010 rad, from Table 3.3"
PUT_IN = {
    "attitude": PACKETS,
    "kf_attitude": PACKETS,
    "prediction (5.33)": "the friction term that jumps is put into the prediction",
}


def equipoise(*arguments: object, fails: bool = False) -> str:
    """Standard output. A failed job (exit status 1) is an error unless `fails`: a robot may fall."""
    command = [str(binary()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=repository_root(), check=False)
    if done.returncode not in ((0, 1) if fails else (0,)):
        raise UserError(f"{' '.join(command)}: {done.stderr.strip() or done.returncode}")
    return done.stdout


def equipoise_json(*arguments: object) -> dict:
    return json.loads(equipoise(*arguments, "--json", "-"))


def _sim(log: Path | str, config: str, sets: dict[str, object] | None, options: dict) -> dict:
    arguments: list[object] = ["sim", "--config", config, "--telemetry", "off", "--json", "-", "--log", log]
    for key, value in options.items():
        flag = "--" + key.replace("_", "-")
        arguments += [flag] if value is True else [flag, value]
    bridges = LOSSLESS if options.get("fidelity") == BUILT else {}
    for key, value in {**PRECISION, **bridges, **(sets or {})}.items():
        arguments += ["--set", f"{key}={value}"]
    return json.loads(equipoise(*arguments, fails=True))


def summarise(config: str = MBBR, sets: dict[str, object] | None = None, **options) -> dict:
    """Summary of a run; options become --yaw-hz and so on, `compare=True` a flag, `sets` --set."""
    return _sim("off", config, sets, options)


def simulate(config: str = MBBR, sets: dict[str, object] | None = None, **options) -> tuple[dict, Log]:
    """(summary, log) of such a run."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        log = Path(folder) / "run.lcm"
        summary = _sim(log, config, sets, options)
        return summary, read_log(log)


@dataclass(frozen=True)
class Case:
    """A condition that is run once per seed. `measure(log)` gives {(filter or "", quantity): number}."""

    name: str
    config: str = MBBR
    sets: dict = field(default_factory=dict)
    options: dict = field(default_factory=dict)
    section: str = ""  # equation of the published EKF's process noise; needed where that filter runs
    gains: str = ""  # of [T], where not the configuration's
    fitted: str = ""
    measure: Callable[[Log, dict], dict] | None = None
    trace: Callable[[Log], dict] | None = None  # of the first seed: series -> (t_s, values)
    trace_s: tuple[float, float] = (0.0, 30.0)
    seeds: tuple[int, ...] | None = None

    @property
    def settings(self) -> dict[str, object]:
        return {**(published.ekf(self.section) if self.section else {}), **self.sets}


def filter_of(case: Case, name: str) -> str:
    return f"{name} as published" if name == "kf_attitude" and is_kf_published(case) else name


def is_kf_published(case: Case) -> bool:
    return all(str(case.sets.get(key)) == value for key, value in published.kf().items())


def control_of(case: Case, summary: dict) -> str:
    controller = summary["controller"]
    if controller == "thesis":
        same = all(str(case.sets.get(key)) == str(value) for key, value in AS_PUBLISHED.items())
        return "thesis as published" if same else "thesis corrected"
    if controller == "slc":
        return "slc as published" if case.sets.get("controller.slc.published") == "true" else "slc redesigned"
    return controller


def gains_of(case: Case, summary: dict) -> str:
    if case.gains:
        return case.gains
    return "[T] Table 6.3" if summary["controller"] == "thesis" else "own gains"


NUMBERS = (
    "attitude_rmse_rad", "ball_speed_rmse_m_s", "wheel_speed_rmse_rad_s", "yaw_frame_speed_rmse_m_s",
    "heading_error_rad", "position_rmse_m", "duty_max",
)  # fmt: skip


def upright_s(summary: dict) -> float:
    return summary["duration_s"] if summary["ended"] == "finished" else summary["fell_at_s"]


def rows_of(case: Case, seed: int, traced: bool) -> Data:
    data = Data()
    options = {**case.options, "seed": seed}
    log = None
    published_runs = options.get("estimator") == "ekf13_published" or options.get("compare")
    if published_runs and case.config == MBBR and not case.section:
        raise UserError(f"{case.name}: which equation's noise does the published EKF run with?")
    if case.measure is not None or (traced and case.trace is not None):
        summary, log = simulate(case.config, case.settings, **options)
    else:
        summary = summarise(case.config, case.settings, **options)
    own = summary["estimator"]
    control, gains = control_of(case, summary), gains_of(case, summary)

    def note(name: str, quantity: str, value: float | None) -> None:
        judged = filter_of(case, name or own)
        own_shown = filter_of(case, own)
        shown = control if judged == own_shown else f"{control} on {own_shown}"
        ran = Ran(judged, shown, summary["fidelity"], gains, case.fitted or PUT_IN.get(name or own, ""))
        data.add(case.name, quantity, np.nan if value is None else value, ran, seed, summary["duration_s"])

    note("", "upright_s", upright_s(summary))
    note("", "held", float(summary["ended"] == "finished"))
    for quantity in NUMBERS:
        if quantity in summary:
            note("", quantity, summary[quantity])
    for name, errors in summary["estimators"].items():
        if name not in (summary["estimator"], "truth"):
            for quantity, value in errors.items():
                note(name, quantity, value)
    if case.measure is not None:
        for (name, quantity), value in case.measure(log, summary).items():
            note(name, quantity, value)
    if traced and case.trace is not None:
        first_s, last_s = case.trace_s
        for series, (t_s, values) in case.trace(log).items():
            data.traces[case.name, series] = thinned(t_s, values, last_s, first_s)
    return data


def _job(job: tuple[Case, int, bool]) -> Data:
    return rows_of(*job)


@dataclass
class Lab:
    """Where runs are done: how many seeds, on how many cores."""

    seeds: int = 20
    jobs: int = 1

    def run(self, cases: list[Case]) -> Data:
        """Every run of every case; the order of the cores does not matter."""
        data = Data()
        jobs = []
        for case in cases:
            seeds = case.seeds or tuple(range(1, self.seeds + 1))
            jobs += [(case, seed, seed == seeds[0]) for seed in seeds]
        with ProcessPoolExecutor(self.jobs) as pool:
            for done, part in enumerate(pool.map(_job, jobs, chunksize=2), 1):
                data.rows += part.rows
                data.traces.update(part.traces)
                if done % 50 == 0 or done == len(jobs):
                    print(f"    {done} of {len(jobs)} runs", file=sys.stderr, flush=True)
        return data


def over_estimate(log: Log, channel: str) -> float:
    """Slope of the estimated ball rate on the true one, both axes, after the run has settled."""
    estimate, truth = metrics.aligned(log, channel, names.TRUTH)
    settled = (estimate["utime"] - log.start_utime) * 1e-6 >= metrics.SETTLE_S
    x = metrics.rolling_rates(truth, 2)[settled].ravel()
    y = metrics.rolling_rates(estimate, 2)[settled].ravel()
    return float(x @ y / (x @ x)) if x.size else float("nan")
