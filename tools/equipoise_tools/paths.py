"""Where the repository and its generated LCM types are."""

from __future__ import annotations

import os
import subprocess
import sys
from datetime import date
from pathlib import Path

from equipoise_robot.errors import UserError

__all__ = ["UserError", "binary", "commit_and_date", "import_lcm_types", "repository_root"]


def repository_root() -> Path:
    return Path(__file__).resolve().parents[2]


def commit_and_date() -> tuple[str, str]:
    """For a report's head: of the code that measures, and today."""
    command = ["git", "-C", str(repository_root()), "describe", "--always", "--dirty"]
    told = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    return told.strip() or "no commit", str(date.today())


def binary() -> Path:
    path = Path(os.environ.get("EQUIPOISE_BINARY", repository_root() / "build" / "host" / "equipoise"))
    if not path.exists():
        raise UserError(f"{path}: not built; run ./tools/run once")
    return path


def import_lcm_types():
    """The generated Python package `equipoise`, from the host build unless it is installed."""
    try:
        import equipoise
    except ModuleNotFoundError:
        built = repository_root() / "build" / "host" / "lcm" / "python"
        if not (built / "equipoise").is_dir():
            raise UserError("the LCM types are not built; run ./tools/run or ./tools/test once") from None
        sys.path.insert(0, str(built))
        import equipoise
    return equipoise
