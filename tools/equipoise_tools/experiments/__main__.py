"""python -m equipoise_tools.experiments [--list] [--jobs N] [--out DIR] [NAME... | all]"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from ..entry import leave
from ..paths import UserError, repository_root
from . import framework


def run_one(name: str, out_dir: str) -> tuple[list[str], float]:
    """Texts of the findings that do not hold, and the seconds it took."""
    started = time.monotonic()
    result = framework.load(name).run(Path(out_dir))
    framework.write(name, result, Path(out_dir))
    return [f"{f.target}: {f.text}" for f in result.findings if not f.holds], time.monotonic() - started


def run_all(chosen: list[str], out_dir: Path, jobs: int) -> int:
    out_dir.mkdir(parents=True, exist_ok=True)
    failures = 0
    with ProcessPoolExecutor(max_workers=jobs) as pool:
        futures = {pool.submit(run_one, name, str(out_dir)): name for name in chosen}
        for done, future in enumerate(as_completed(futures), 1):
            name = futures[future]
            head = f"[{done}/{len(chosen)}] {name}"
            try:
                missed, seconds = future.result()
            except UserError as error:
                print(f"{head}: failed: {error}", flush=True)
                failures += 1
                continue
            except Exception as error:  # one broken experiment must not stop the others
                print(f"{head}: failed: {type(error).__name__}: {error}", flush=True)
                failures += 1
                continue
            print(f"{head}: {seconds:.1f} s, {'all findings hold' if not missed else 'does not hold:'}")
            for text in missed:
                print(f"    {text}")
            failures += bool(missed)
            sys.stdout.flush()
    (out_dir / "README.md").write_text(framework.summary(out_dir))
    print(f"{out_dir / 'README.md'}: {len(chosen)} run, {failures} not as stated", flush=True)
    return 1 if failures else 0


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tools/experiments", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help="experiments; all: every one (default)")
    parser.add_argument("--list", action="store_true", help="name them")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="experiments at a time")
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "experiments")
    options = parser.parse_args(arguments)
    known = framework.names()
    if options.list:
        for name in known:
            module = framework.load(name)
            print(f"{name:<24}{', '.join(getattr(module, 'COVERS', ()))}")
        return 0
    if options.jobs < 1:
        parser.error("--jobs: 1 or more")
    chosen = known if not options.names or "all" in options.names else options.names
    unknown = [name for name in chosen if name not in known]
    if unknown:
        print(f"error: no experiment {', '.join(unknown)}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    return run_all(chosen, options.out, options.jobs)


if __name__ == "__main__":
    leave(main)
