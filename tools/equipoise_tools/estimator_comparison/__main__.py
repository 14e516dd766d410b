"""The MBBR's default filter beside an unscented and an error-state filter of its model, on the same samples.

python -m equipoise_tools.estimator_comparison              the page's tables and figure, anew: 10 minutes
python -m equipoise_tools.estimator_comparison --from-data  from docs/reports/estimators.parquet
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ..entry import leave
from ..paths import UserError, commit_and_date, repository_root
from . import measure, page

CASES = ((0.0, 0.3), (1.0, 0.2), (2.0, 0.2), (3.0, 0.2))  # Hz, m/s


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="estimator_comparison", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=2101, help="robot of the population")
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each run")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--from-data", action="store_true", help="no runs: from the data")
    parser.add_argument(
        "--out", type=Path, default=repository_root() / "docs" / "reports", help="folder of the page"
    )
    options = parser.parse_args(arguments)
    if options.robots < 2 or options.duration < 8.0:
        parser.error("--robots: 2 or more; --duration: 8 or more")
    table = options.out / "estimators.parquet"
    if not options.from_data:
        began = time.monotonic()
        numbers = range(options.first, options.first + options.robots)
        rows = measure.measure(numbers, CASES, options.duration, options.seed)
        measure.write(table, rows)
        print(f"{table}: {len(rows)} rows in {time.monotonic() - began:.0f} s")
    try:
        rows = measure.read(table)
    except OSError as error:
        reason = error.strerror or "cannot be read"  # pyarrow's has none
        raise UserError(f"{table}: {reason}; run without --from-data") from None
    page.draw(rows, options.out)
    text = page.tables(rows)
    print(text)
    measured = None if options.from_data else ", ".join(commit_and_date())
    page.insert(options.out / "estimators.md", text, measured)
    return 0


if __name__ == "__main__":
    leave(main)
