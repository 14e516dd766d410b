"""Simulated runs and designs: the numbers of `equipoise sim` and `equipoise design`, in process."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from . import _core
from . import channels as ch
from ._core import ControllerTick, EstimatorTick, State
from ._data import configuration
from .errors import UserError
from .log import Log

Controller = Callable[[ControllerTick], Sequence[float]]
Estimator = Callable[[EstimatorTick], State]


class Figures:
    """What a run or a design came to, under the names of the command's JSON; what was not counted is None."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)

    def to_dict(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "log"}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.to_dict().items())})"


class Run(Figures):
    """One simulated run. Errors are against the plant's truth after the first 5 s."""

    robot: str
    robot_number: int
    seed: int
    estimator: str
    controller: str
    fidelity: str
    attitude: str
    yaw_hz: float
    drive_mps: float
    path: str | None
    duration_s: float
    ended: str  # finished, fell, disarmed, interrupted
    reasons: list[str]
    fell: bool
    fell_at_s: float | None
    attitude_rmse_rad: float | None
    ball_speed_rmse_m_s: float | None  # MBBR
    wheel_speed_rmse_rad_s: float | None  # MIP
    yaw_frame_speed_rmse_m_s: float | None
    heading_error_rad: float | None
    position_rmse_m: float | None
    path_rmse_m: float | None
    normalized_innovation_mean: float | None
    yaw_rate_mean_hz: float | None
    duty_max: float
    saturated_fraction: float
    degraded: list[str]
    verdicts: list[dict[str, Any]] | None  # on sensors; None: no hypothesis was weighed
    ticks: int
    real_time_factor: float
    estimators: dict[str, dict[str, float | None]]
    config_sha256: str
    version: str
    log: Log | None  # of a recorded run


class Design(Figures):
    """Gains of a configuration, and per yaw rate the margins of the loop with filter and delays in it."""

    robot: str
    estimator: str
    controller: str
    config_sha256: str
    gains: dict[str, Any]
    rows: list[dict[str, Any]]


def settings(values: dict[str, Any] | Iterable[str]) -> list[str]:
    """{"friction.compensation": 0.8} or ["friction.compensation=0.8"] as --set has it."""
    if isinstance(values, str):
        raise UserError("set: expected a dictionary or a list of 'key=value'")
    if not isinstance(values, dict):
        return list(values)
    return [f"{key}={json.dumps(value)}" for key, value in values.items()]


def request(robot: str | Path, **asked: Any) -> _core.Request:
    """A run as it is asked for; names as in run()."""
    out = _core.Request()
    out.config = configuration(robot)
    asked["set"] = settings(asked.get("set", ()))
    asked["yaw_rate_rad_s"] = 2.0 * math.pi * asked.pop("yaw_hz", 0.0)
    for name, value in asked.items():
        if value is not None:
            setattr(out, name, value)
    return out


def recorded(columns: dict[str, tuple[list[tuple[str, str, int]], bytes]], run: SimpleNamespace) -> Log:
    records: dict[str, np.ndarray] = {}
    for channel, (fields, packed) in columns.items():
        dtype = [(name, kind, count) if count else (name, kind) for name, kind, count in fields]
        records[channel] = np.frombuffer(packed, np.dtype(dtype))
    described = np.empty(1, object)
    described[0] = run
    return Log.of(records | {ch.RUN: described})


def named(function: object) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


def run(
    robot: str | Path = "mbbr",
    *,
    yaw_hz: float = 0.0,
    drive_mps: float = 0.0,
    duration_s: float = 30.0,
    seed: int = 1,
    estimator: str | Estimator | None = None,
    controller: str | Controller | None = None,
    fidelity: str = "nominal",
    attitude: str = "dmp",
    robot_number: int = 0,
    path: str | Path | None = None,
    set: dict[str, Any] | Iterable[str] = (),
    compare: bool = False,
    record: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Simulates a robot through the production pipeline.

    robot: "mbbr", "mip" (the eduMIP), or a configuration file; robot_number: of its population, 0 the typical
    one. estimator, controller: a name, or a function of your own. A controller gets a ControllerTick and
    returns u about the input axes; an estimator gets an EstimatorTick and returns a State. What it raises
    ends the run and is raised. set: overrides of configuration keys. compare: run every estimator on the same
    samples. record: keep every tick in `log`. progress: called now and then with the simulated time.
    """
    own_estimator = estimator if callable(estimator) else None
    own_controller = controller if callable(controller) else None
    asked = request(
        robot,
        yaw_hz=yaw_hz,
        drive_mps=drive_mps,
        duration_s=duration_s,
        seed=seed,
        estimator=None if own_estimator else estimator,
        controller=None if own_controller else controller,
        fidelity=fidelity,
        attitude=attitude,
        robot_number=robot_number,
        path=None if path is None else str(path),
        set=set,
        compare=compare,
    )
    text, columns = _core.run(asked, own_controller, own_estimator, record, progress)
    values = json.loads(text)
    toml = values.pop("config_toml")
    if own_estimator:
        values["estimator"] = named(own_estimator)
    if own_controller:
        values["controller"] = named(own_controller)
    about = ("robot", "estimator", "controller", "fidelity", "seed", "version", "config_sha256", "attitude")
    described = SimpleNamespace(**{key: values[key] for key in about}, config_toml=toml, backend="sim")
    values["log"] = recorded(columns, described) if record else None
    return Run(values)


def design(
    robot: str | Path = "mbbr",
    *,
    estimator: str | None = None,
    controller: str | None = None,
    last_hz: float = 3.0,
    step_hz: float = 0.5,
    set: dict[str, Any] | Iterable[str] = (),
    bode: bool = False,
) -> Design:
    """Gains and margins over the yaw rate; bode: with the frequency responses."""
    if not 0.0 <= last_hz <= 10.0 or not 0.01 <= step_hz <= 10.0:
        raise UserError("last_hz: 0 to 10; step_hz: 0.01 to 10")
    text = _core.design(
        configuration(robot), settings(set), estimator or "", controller or "", last_hz, step_hz, bode
    )
    return Design(json.loads(text))
