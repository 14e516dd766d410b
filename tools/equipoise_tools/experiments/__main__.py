"""The dissertation's tables and figures, each as one command."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from .. import style
from ..entry import leave
from ..paths import UserError, repository_root
from . import data, framework
from .runs import Lab


def run_one(name: str, out_dir: Path, lab: Lab | None) -> list[str]:
    """Measures, unless `lab` is None, and writes the page from the data. Texts that do not hold."""
    module = framework.load(name)
    if lab is not None:
        data.write(name, framework.measured(module, lab), out_dir)
    made = data.read(name, out_dir)
    result = module.report(made, out_dir)
    framework.write(name, result, out_dir, made.at)
    return [f"{f.target}: {f.text} ({f.ran})" for f in result.findings if not f.holds]


def run_all(chosen: list[str], out_dir: Path, lab: Lab | None) -> int:
    out_dir.mkdir(parents=True, exist_ok=True)
    failures, began = 0, time.monotonic()
    for done, name in enumerate(chosen, 1):
        head = f"[{done}/{len(chosen)}] {name}"
        started = time.monotonic()
        try:
            missed = run_one(name, out_dir, lab)
        except (UserError, OSError) as error:
            print(f"{head}: failed: {error}", flush=True)
            failures += 1
            continue
        seconds = time.monotonic() - started
        print(f"{head}: {seconds:.1f} s, {'all findings hold' if not missed else 'do not hold:'}")
        for text in missed:
            print(f"    {text}")
        sys.stdout.flush()
    (out_dir / "README.md").write_text(framework.summary(out_dir))
    print(f"{out_dir / 'README.md'}: {len(chosen)} in {time.monotonic() - began:.0f} s, {failures} failed")
    return 1 if failures else 0


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tools/experiments", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help="experiments; all: every one (default)")
    parser.add_argument("--list", action="store_true", help="name them")
    parser.add_argument("--from-data", action="store_true", help="no runs: pages from the data in DIR/data")
    parser.add_argument("--svg", action="store_true", help="each figure as SVG, too")
    parser.add_argument("--seeds", type=int, default=20, help="runs per condition")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="runs at a time")
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "experiments")
    options = parser.parse_args(arguments)
    known = framework.names()
    if options.list:
        for name in known:
            print(f"{name:<24}{', '.join(framework.load(name).COVERS)}")
        return 0
    if options.jobs < 1 or options.seeds < 2:
        parser.error("--jobs: 1 or more; --seeds: 2 or more")
    chosen = known if not options.names or "all" in options.names else options.names
    unknown = [name for name in chosen if name not in known]
    if unknown:
        print(f"error: no experiment {', '.join(unknown)}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    if options.svg:
        os.environ[style.SVG_TOO] = "1"
    lab = None if options.from_data else Lab(options.seeds, options.jobs)
    return run_all(chosen, options.out, lab)


if __name__ == "__main__":
    leave(main)
