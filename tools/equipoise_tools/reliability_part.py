"""What every part of docs/reports/reliability.md needs: rows, and how its commands are run."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass, field

from .paths import repository_root

ROOT = repository_root()
BUILD = ROOT / "build" / "host"
BINARY = BUILD / "equipoise"
CONFIGS = {"eduMIP": "config/edumip.toml", "MBBR": "config/mbbr.toml"}


@dataclass
class Part:
    """Rows of the summary (what, wanted, measured, holds; None: skipped) and a section of its own."""

    rows: list[tuple[str, str, str, bool | None]] = field(default_factory=list)
    section: str = ""


def output(*command, check: bool = True, **options) -> str:
    ended = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=ROOT, **options)
    if check and ended.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}: {ended.stdout[-500:]}{ended.stderr[-2000:]}")
    return ended.stdout


def isolated(*command) -> list:
    return [ROOT / "tools/lib/multicast", *command]
