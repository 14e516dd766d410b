"""Equipoise's simulator, design and logs in Python: balancing robots, in process."""

from importlib import import_module as _import_module
from importlib.util import find_spec as _find_spec
from pkgutil import extend_path as _extend_path
from typing import TYPE_CHECKING, Any

__path__ = _extend_path(__path__, __name__)  # in the repository, _core stands in the build folder

from .errors import UserError
from .log import Log

if TYPE_CHECKING:
    from ._core import ControllerTick, EstimatorTick, State, controllers, error_names, estimators
    from .simulation import Design, Run, design, run
    from .sweeps import sweep

# What needs the compiled part is imported when it is asked for: logs are read without it.
_LATER = {
    "ControllerTick": "_core",
    "Design": "simulation",
    "EstimatorTick": "_core",
    "Run": "simulation",
    "State": "_core",
    "controllers": "_core",
    "design": "simulation",
    "error_names": "_core",
    "estimators": "_core",
    "run": "simulation",
    "sweep": "sweeps",
}

__all__ = [
    "ControllerTick",
    "Design",
    "EstimatorTick",
    "Log",
    "Run",
    "State",
    "UserError",
    "controllers",
    "design",
    "error_names",
    "estimators",
    "register_envs",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _import_module("._core", __name__).version()
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(_import_module(f".{_LATER[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def register_envs() -> None:
    """The environments by id. Importing the package calls it where Gymnasium is installed."""
    from gymnasium.envs.registration import register, registry

    for name, robot in {"Mbbr": "mbbr", "Mip": "mip"}.items():
        if f"Equipoise-{name}-v0" not in registry:
            register(
                id=f"Equipoise-{name}-v0",
                entry_point="equipoise_robot.envs:BalanceEnv",
                vector_entry_point="equipoise_robot.envs:BalanceVectorEnv",
                kwargs={"robot": robot},
                max_episode_steps=2000,
            )


if _find_spec("gymnasium") is not None:
    register_envs()
