"""python -m equipoise_tools.report LOG [--out DIR]: picture, page and numbers of a run."""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path

from .entry import leave
from .figures import draw_report, headline
from .log import Log, read_log
from .metrics import Summary, summarise
from .page import estimator_rows, number_rows, page
from .paths import UserError
from .style import plt


def print_numbers(log: Log, summary: Summary) -> None:
    for note in log.notes:
        print(f"note: {note}")
    for what, value in number_rows(summary):
        print(f"{what + ':':<32}{value}")
    if summary.estimators:
        head, rows = estimator_rows(summary)
        for row in (head, *rows):
            print(f"{row[0]:<18}{row[1]:>20}{row[2]:>20}")


def write_report(log: Log, summary: Summary, out: Path) -> tuple[Path, Path]:
    """report.png and report.html in the folder."""
    figure = draw_report(log, summary)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    plt.close(figure)
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "report.png").write_bytes(picture.getvalue())
        (out / "report.html").write_text(page(headline(log, summary), log, summary, [picture.getvalue()]))
    except OSError as error:
        raise UserError(f"{error.filename or out}: {error.strerror}") from None
    return out / "report.png", out / "report.html"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.report", description="Draws report.png and report.html of a log."
    )
    parser.add_argument("log", metavar="LOG", type=Path, help="an LCM event log written by equipoise")
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to (default: the log's folder)")
    options = parser.parse_args(arguments)
    try:
        log = read_log(options.log)
        summary = summarise(log)
        written = write_report(log, summary, options.out or options.log.parent)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print_numbers(log, summary)
    for path in written:
        print(path)
    return 0


if __name__ == "__main__":
    leave(main)
