"""python -m equipoise_tools.report LOG... [--out DIR]: picture, page and numbers of a run, or of several."""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path

from equipoise_robot.log import Log, read_log

from .entry import leave
from .figures import draw_report, headline
from .interactive import UPLOT, Run
from .metrics import Summary, number_rows, summarise
from .page import comparison, estimator_rows, page
from .paths import UserError
from .style import plt
from .what_if import NOTE, what_if


def print_numbers(log: Log, summary: Summary) -> None:
    for note in log.notes:
        print(f"note: {note}")
    for what, value in number_rows(summary):
        print(f"{what + ':':<31} {value}")
    if summary.estimators:
        head, rows = estimator_rows(summary)
        for row in (head, *rows):
            print(f"{row[0]:<18}{row[1]:>20}{row[2]:>20}")


def picture_of(run: Run) -> bytes:
    figure = draw_report(run.log, run.summary)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    plt.close(figure)
    return picture.getvalue()


def write_report(runs: list[Run], out: Path, note: str = "") -> list[Path]:
    """report.html and report.png in the folder; of a second log report-2.png, and so on."""
    pictures = [picture_of(run) for run in runs]
    titles = [headline(run.log, run.summary) for run in runs]
    text = (
        page(titles[0], runs[0], pictures[0]) if len(runs) == 1 else comparison(runs, titles, pictures, note)
    )
    paths = [out / ("report.png" if i == 0 else f"report-{i + 1}.png") for i in range(len(runs))]
    try:
        out.mkdir(parents=True, exist_ok=True)
        for path, picture in zip(paths, pictures, strict=True):
            path.write_bytes(picture)
        (out / "report.html").write_text(text)
    except OSError as error:
        raise UserError(f"{error.filename or out}: {error.strerror}") from None
    return [*paths, out / "report.html"]


def names_of(paths: list[Path]) -> list[str]:
    """File names, with their folders where these alone tell them apart."""
    if len({path.name for path in paths}) == len(paths):
        return [path.name for path in paths]
    return [str(path) for path in paths]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.report", description="Draws report.png and report.html of a log."
    )
    parser.add_argument(
        "logs",
        metavar="LOG",
        type=Path,
        nargs="+",
        help="an LCM event log written by equipoise; several are compared",
    )
    parser.add_argument("--out", metavar="DIR", type=Path, help="where to (default: the first log's folder)")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="beside one log: what this tuning would have made of it, as equipoise replay --set",
    )
    options = parser.parse_args(arguments)
    out = options.out or options.logs[0].parent
    try:
        if options.set and len(options.logs) > 1:
            raise UserError("--set: takes one log")
        shown = names_of(options.logs)
        if options.set:
            changed, note = what_if(options.logs[0], options.set, out)
            if note:
                print(f"note: {note}")
            options.logs.append(changed)
            shown.append(", ".join(options.set))
        logs = [read_log(path) for path in options.logs]
        runs = [Run(name, log, summarise(log)) for name, log in zip(shown, logs, strict=True)]
        written = write_report(runs, out, NOTE if options.set else "")
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for run in runs:
        if len(runs) > 1:
            print(f"{run.name}")
        print_numbers(run.log, run.summary)
    if not (UPLOT / "uPlot.iife.min.js").is_file():
        print("note: report.html has pictures only: uPlot is not installed (./tools/run does it)")
    for path in written:
        print(path)
    return 0


if __name__ == "__main__":
    leave(main)
