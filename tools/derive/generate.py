"""Regenerates config/generated, or with --check compares it with what the scripts give now.

python3 -m tools.derive            write every file
python3 -m tools.derive --check    exit 1 and name the file when one is stale
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from pathlib import Path

from . import filter_header, mbbr_filter, mbbr_header, mip_filter, mip_header

TARGETS = {
    "mbbr_model.hpp": mbbr_header.render,
    "mip_model.hpp": mip_header.render,
    "mbbr_filter.hpp": lambda: filter_header.render(mbbr_filter.made()),
    "mbbr_filter.cpp": lambda: filter_header.render_code(mbbr_filter.made()),
    "mip_filter.hpp": lambda: filter_header.render(mip_filter.made()),
    "mip_filter.cpp": lambda: filter_header.render_code(mip_filter.made()),
}
DEFAULT_FOLDER = Path(__file__).resolve().parents[2] / "config" / "generated"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:e[-+]?\d+)?(?!\w)")
# Coefficients are reduced by a computer algebra system, whose releases differ in the last digits.
RELATIVE_TOLERANCE = 1e-6


def same(old: str, new: str) -> bool:
    """Equal text, with decimal numbers compared to RELATIVE_TOLERANCE."""
    if NUMBER.sub("#", old) != NUMBER.sub("#", new):
        return False
    pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=RELATIVE_TOLERANCE, abs_tol=1e-12) for a, b in pairs)


def stale(folder: Path) -> list[str]:
    """What is wrong with the committed files."""
    found = []
    for name, render in TARGETS.items():
        path = folder / name
        if not path.is_file():
            found.append(f"{path}: missing")
        elif not same(path.read_text(encoding="utf-8"), render()):
            found.append(f"{path}: stale")
    return found


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(prog="python3 -m tools.derive", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only; exit 1 when a file is stale")
    parser.add_argument("--output", type=Path, default=DEFAULT_FOLDER, help="folder of the files")
    options = parser.parse_args(arguments)
    found = stale(options.output) if options.check else []
    for problem in found:
        print(f"{problem}; run python3 -m tools.derive", file=sys.stderr)
    if not options.check:
        options.output.mkdir(parents=True, exist_ok=True)
        for name, render in TARGETS.items():
            (options.output / name).write_text(render(), encoding="utf-8")
            print(f"wrote {options.output / name}")
    return 1 if found else 0
