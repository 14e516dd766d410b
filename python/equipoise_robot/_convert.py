"""The command line of a converter: LOG and --out PATH."""

from __future__ import annotations

import argparse
import shutil
import struct
import sys
from collections.abc import Callable
from pathlib import Path

from .errors import UserError
from .log import Log

# What a log that somebody made up may come to.
MADE_UP = ArithmeticError, LookupError, TypeError, ValueError, struct.error


def convert(
    to: str,
    about: str | None,
    write: Callable[[Log, Path], dict[str, int] | str],
    arguments: list[str] | None,
) -> int:
    parser = argparse.ArgumentParser(prog=f"python -m equipoise_robot.{to}", description=about)
    parser.add_argument("log", metavar="LOG", type=Path, help="an LCM event log written by equipoise")
    parser.add_argument("--out", metavar="PATH", type=Path, help="what to make (default: beside the log)")
    given = parser.parse_args(arguments)
    out = given.out or given.log.with_suffix(f".{to}")
    there = out.exists()
    try:
        log = Log(given.log)
        counts = write(log, out)
    except (*MADE_UP, ModuleNotFoundError, OSError) as error:
        if not isinstance(error, (ModuleNotFoundError, OSError, UserError)):
            why = " ".join(f"{type(error).__name__}: {error}".split())
            error = UserError(f"{given.log}: no log as equipoise writes it ({why})")
        if not there and out.is_file():
            out.unlink()
        elif not there:
            shutil.rmtree(out, ignore_errors=True)
        print(f"error: {error}", file=sys.stderr)
        return 2
    for note in log.notes:
        print(f"note: {note}")
    if not isinstance(counts, str):
        counts = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    print(f"{out}: {counts}")
    return 0
