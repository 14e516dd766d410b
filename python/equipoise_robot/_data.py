"""Where the package's files are: configurations and message types, beside it when installed."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from .errors import UserError

_HERE = Path(__file__).resolve().parent
_REPOSITORY = _HERE.parents[1]
CONFIG = _HERE / "config" if (_HERE / "config").is_dir() else _REPOSITORY / "config"
LCM = _HERE / "lcm" if (_HERE / "lcm").is_dir() else _REPOSITORY / "lcm"

ROBOTS = {"mbbr": "mbbr.toml", "mip": "edumip.toml"}


def configuration(robot: str | Path) -> str:
    """The file for a robot's name, or the file itself."""
    if isinstance(robot, str) and robot in ROBOTS:
        return str(CONFIG / ROBOTS[robot])
    path = Path(robot)
    if not path.is_file():
        raise UserError(
            f"{path}: no such configuration file, nor a robot's name; the robots are {', '.join(ROBOTS)}"
        )
    return str(path)


def need(module: str, extra: str) -> Any:
    """An optional library, or how to get it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        raise ModuleNotFoundError(
            f"{module} is not installed; in a clone: pip install '.[{extra}]'", name=module
        ) from None
