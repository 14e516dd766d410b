"""The report as one HTML file that needs nothing else: plots and pictures inside it, numbers as tables."""

from __future__ import annotations

import base64
import math
from html import escape

from equipoise_robot.log import Log

from .interactive import Run, fragment
from .metrics import Summary, number_rows, run_record

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1200px; margin: 2rem auto; }
h1 { font-size: 1.4rem; margin-bottom: 0.2rem; } h2 { font-size: 1.05rem; margin-top: 1.6rem; }
table { border-collapse: collapse; margin: 0.4rem 0; }
th, td { text-align: left; padding: 0.2rem 1.4rem 0.2rem 0; border-bottom: 1px solid #e3e3e3; }
th { font-weight: 600; color: #555; } td.number { text-align: right; font-variant-numeric: tabular-nums; }
img { width: 100%; height: auto; }
body { padding: 0 0.8rem; } .wide { overflow-x: auto; }
.u-legend th, .u-legend td { border: 0; padding: 0 0.3rem; }
#plots { display: flex; flex-wrap: wrap; gap: 0.4rem 1rem; }
.note { background: #fff4e5; border-left: 4px solid #D55E00; padding: 0.4rem 0.8rem; }
.fine { color: #777; font-size: 0.85rem; overflow-wrap: anywhere; }
"""


def _table(rows: list[tuple[str, ...]], head: tuple[str, ...] = ()) -> str:
    def cell(index: int, text: str) -> str:
        return f'<td{" class=number" if index else ""}>{escape(text)}</td>'

    lines = ["<table>"]
    if head:
        lines.append("<tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>")
    lines += ["<tr>" + "".join(cell(i, text) for i, text in enumerate(row)) + "</tr>" for row in rows]
    return "\n".join([*lines, "</table>"])


def estimator_rows(summary: Summary) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """(head, rows) of the estimators' errors against the truth; the controlling one first."""
    in_metres = all(errors.speed_rmse_m_s is not None for errors in summary.estimators.values())
    head = ("estimator", "attitude RMSE (rad)", "speed RMSE (cm/s)" if in_metres else "speed RMSE (rad/s)")
    rows = []
    for name, errors in summary.estimators.items():
        speed = 100 * errors.speed_rmse_m_s if in_metres else errors.rolling_rmse_rad_s
        counted = math.isfinite(errors.attitude_rmse_rad)  # else the run ended before errors count
        rows.append(
            (name, f"{errors.attitude_rmse_rad:.5f}", f"{speed:.3f}") if counted else (name, "-", "-")
        )
    return head, rows


def _picture(title: str, png: bytes) -> str:
    return f'<p><img alt="{escape(title)}" src="data:image/png;base64,{base64.b64encode(png).decode()}"></p>'


def _source(log: Log) -> str:
    source = f"{log.path.name}"
    run = run_record(log)
    if run is not None:
        source += f" · equipoise {run.version} · configuration SHA-256 {run.config_sha256}"
    return f'<p class="fine">{escape(source)}</p>'


def _head(title: str) -> list[str]:
    return [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
    ]


def comparison(runs: list[Run], titles: list[str], pictures: list[bytes], note: str = "") -> str:
    """Several logs: their numbers side by side, their plots over each other."""
    parts = _head("Comparison of " + ", ".join(run.name for run in runs))
    if note:
        parts.append(f'<p class="note">{escape(note)}</p>')
    parts += [
        f'<p class="note">{escape(run.name)}: {escape(note)}</p>' for run in runs for note in run.log.notes
    ]
    numbers = [dict(number_rows(run.summary)) for run in runs]
    keys = list(dict.fromkeys(key for rows in numbers for key in rows))
    rows = [("run", *titles)] + [(key, *(rows.get(key, "-") for rows in numbers)) for key in keys]
    parts.append(f'<div class="wide">{_table(rows, ("", *(run.name for run in runs)))}</div>')
    parts.append(fragment(runs))
    for run, title, png in zip(runs, titles, pictures, strict=True):
        parts.append(
            f"<details><summary>{escape(run.name)}: {escape(title)}</summary>{_picture(title, png)}</details>"
        )
    parts += [_source(run.log) for run in runs]
    return "\n".join([*parts, "</body></html>"]) + "\n"


def page(title: str, run: Run, picture: bytes) -> str:
    log, summary = run.log, run.summary
    parts = _head(title)
    parts += [f'<p class="note">{escape(note)}</p>' for note in log.notes]
    parts.append(f'<div class="wide">{_table(number_rows(summary))}</div>')
    if summary.estimators:
        head, rows = estimator_rows(summary)
        parts.append("<h2>Estimators against the simulation's truth</h2>")
        parts.append(f'<div class="wide">{_table(rows, head)}</div>')
    plots = fragment([run])
    parts.append(plots)
    image = _picture(title, picture)
    parts.append(f"<details><summary>Picture</summary>{image}</details>" if plots else image)
    if summary.events:
        rows = [(f"{t_s:.3f} s", what) for t_s, what in summary.events]
        parts += ["<h2>Motors' permission</h2>", _table(rows, ("time", "state and reasons"))]
    parts += [_source(log), "</body></html>"]
    return "\n".join(parts) + "\n"
