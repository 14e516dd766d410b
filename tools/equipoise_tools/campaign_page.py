"""The page of a campaign: tables, pictures, and the command that runs each of the worst cases again."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path

import numpy as np

from .campaign_statistics import influences, quantile_interval, survival_over_time, wilson
from .paths import commit_and_date

WORST = 12


def _column(rows: list[dict], key: str) -> np.ndarray:
    return np.array([np.nan if row.get(key) is None else row[key] for row in rows], dtype=float)


def _count(rows: list[dict], key: str) -> str:
    """How many; "-" where no twin has run that would tell."""
    values = [row[key] for row in rows if row.get(key) is not None]
    return str(sum(values)) if values else "-"


def points_of(rows: list[dict]) -> list[tuple[float, float]]:
    return sorted({(row["yaw_hz"], row["drive_mps"]) for row in rows})


def at_point(rows: list[dict], point: tuple[float, float]) -> list[dict]:
    return [row for row in rows if (row["yaw_hz"], row["drive_mps"]) == point]


def replay_command(row: dict, settings: dict) -> str:
    """One line that runs this trial again; with a log, where our own world ran it."""
    if settings["engine"] == "mujoco":
        words = ["tools/campaign", "--engine", "mujoco", "--floor", settings["floor"]]
        words += ["--config", settings["config"], "--first-robot", str(row["robot"]), "--robots", "1"]
        words += ["--runs", f"{row['yaw_hz']:g},{row['drive_mps']:g}", "--out", "build/one"]
        return shlex.join(words)
    words = [
        "build/host/equipoise",
        "sim",
        "--config",
        settings["config"],
        "--fidelity",
        settings["fidelity"],
    ]
    for flag, key in (
        ("--robot", "robot"),
        ("--seed", "seed"),
        ("--yaw-hz", "yaw_hz"),
        ("--drive-mps", "drive_mps"),
    ):
        words += [flag, f"{row[key]:g}" if isinstance(row[key], float) else str(row[key])]
    words += ["--duration-s", f"{row['duration_s']:g}"]
    for choice in ("estimator", "controller"):
        if settings.get(choice):
            words += [f"--{choice}", settings[choice]]
    for text in settings["set"]:
        words += ["--set", text]
    return shlex.join(words)


def why(row: dict) -> str:
    """It fell although its motors ran, or they went off."""
    return ", ".join(row["reasons"]) or row["ended"]


def worse_half(rows: list[dict]) -> tuple[np.ndarray, str]:
    """Which rows to tell from the others, and what they are called."""
    fell = np.array([row["fell"] for row in rows])
    if fell.any():
        return fell, "fallen"
    attitude = _column(rows, "attitude_rmse_rad")
    return attitude >= np.quantile(attitude, 0.9), "worst tenth in attitude"


def drawn_of(rows: list[dict]) -> dict[str, np.ndarray]:
    names = sorted({name for row in rows for name in row["drawn"]})
    return {name: np.array([row["drawn"].get(name, np.nan) for row in rows]) for name in names}


def survival_table(rows: list[dict]) -> list[str]:
    lines = [
        "| yaw Hz | m/s | trials | upright | 95 % interval | healthy sensor excluded | off though it stands "
        "| saved by detector |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for yaw, drive in points_of(rows):
        here = at_point(rows, (yaw, drive))
        upright = sum(not row["fell"] for row in here)
        low, high = wilson(upright, len(here))
        judged = [
            _count(here, key) for key in ("excluded_healthy", "off_though_it_stands", "saved_by_detector")
        ]
        lines.append(
            f"| {yaw:g} | {drive:g} | {len(here)} | {100 * upright / len(here):.2f} % | "
            f"{100 * low:.2f} - {100 * high:.2f} % | {' | '.join(judged)} |"
        )
    return lines


ERRORS = (
    ("attitude_rmse_rad", "attitude RMSE, rad", 1.0, "{:.4f}"),
    ("yaw_frame_speed_rmse_m_s", "speed RMSE in the yaw frame, cm/s", 100.0, "{:.2f}"),
    ("heading_error_rad", "heading error at the end, rad", 1.0, "{:.3f}"),
    ("position_rmse_m", "position RMSE, m (heading's drift included)", 1.0, "{:.3f}"),
)


def error_table(rows: list[dict], errors=ERRORS) -> list[str]:
    """Of the upright: median and 95th percentile over the trials, each with its 95 % interval."""
    lines = ["| yaw Hz | m/s | error | median | 95th percentile |", "|---|---|---|---|---|"]
    for yaw, drive in points_of(rows):
        upright = [row for row in at_point(rows, (yaw, drive)) if not row["fell"]]
        for key, name, scale, form in errors:
            values = scale * np.abs(_column(upright, key))
            values = values[np.isfinite(values)]
            if len(values) == 0:
                continue
            cells = []
            for share in (0.5, 0.95):
                value, low, high = (form.format(x) for x in quantile_interval(values, share))
                cells.append(f"{value} ({low} - {high})")
            lines.append(f"| {yaw:g} | {drive:g} | {name} | {cells[0]} | {cells[1]} |")
    return lines


def draw_pictures(rows: list[dict], out: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (over_yaw, over_time) = plt.subplots(1, 2, figsize=(11, 4.2))
    for speed in sorted({drive for _, drive in points_of(rows)}):
        points = [p for p in points_of(rows) if p[1] == speed]
        counts = [(sum(not r["fell"] for r in at_point(rows, p)), len(at_point(rows, p))) for p in points]
        shares = np.array([100 * k / n for k, n in counts])
        bounds = np.array([[100 * x for x in wilson(k, n)] for k, n in counts])
        spread = np.maximum(0.0, np.abs(bounds.T - shares))
        yaw = [p[0] for p in points]
        over_yaw.errorbar(yaw, shares, yerr=spread, marker="o", capsize=3, label=f"{speed:g} m/s")
    over_yaw.set(xlabel="yaw rate, Hz", ylabel="upright to the end, %", ylim=(-2, 102))
    over_yaw.legend()
    for point in points_of(rows):
        here = at_point(rows, point)
        duration = max(row["duration_s"] for row in here)
        times, left = survival_over_time(_column(here, "fell_at_s"), duration)
        over_time.step(times, 100 * left, where="post", label=f"{point[0]:g} Hz, {point[1]:g} m/s")
    over_time.set(xlabel="time, s", ylabel="still upright, %", ylim=(-2, 102))
    over_time.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out / "survival.png", dpi=110)
    plt.close(figure)

    worse, name = worse_half(rows)
    strongest = influences(drawn_of(rows), worse)[:12][::-1]
    if strongest:
        figure, axes = plt.subplots(figsize=(8, 4.5))
        axes.barh([f"{i.name} ({i.measure})" for i in strongest], [i.z for i in strongest])
        axes.axvspan(-2, 2, color="0.9", zorder=0)
        axes.set(xlabel=f"standard deviations by which the {name} differ (grey: chance)")
        figure.tight_layout()
        figure.savefig(out / "sensitivity.png", dpi=110)
        plt.close(figure)


def made_by(rows: list[dict], settings: dict) -> str:
    """The command that makes this page, with the commit and the day it was made."""
    robots = sorted({row["robot"] for row in rows})
    words = ["tools/campaign", "--config", settings["config"], "--engine", settings["engine"]]
    words += ["--floor", settings["floor"]] if settings["floor"] != "calm" else []
    words += ["--twins"] if settings["twins"] else []
    words += [
        "--fidelity",
        settings["fidelity"],
        "--first-robot",
        str(robots[0]),
        "--robots",
        str(len(robots)),
    ]
    words += ["--runs", *(f"{yaw:g},{drive:g}" for yaw, drive in points_of(rows))]
    words += ["--duration-s", f"{settings['duration_s']:g}"]
    for key in ("estimator", "controller"):
        words += [f"--{key}", settings[key]] if settings[key] else []
    for text in settings["set"]:
        words += ["--set", text]
    made = f"Made by `{shlex.join(words)}`"
    commit, today = commit_and_date()
    return f"{made} at {commit}, {today}; each robot's seed is its number."


def engine_of(settings: dict) -> str:
    return f" in MuJoCo, {settings['floor']} floor" if settings.get("engine") == "mujoco" else ""


def reasons_table(rows: list[dict]) -> list[str]:
    counts = Counter(why(row) for row in rows if row["fell"])
    return [
        "| reasons | trials |",
        "|---|---|",
        *(f"| {reason} | {n} |" for reason, n in counts.most_common()),
    ]


def sensitivity_table(rows: list[dict], worse: np.ndarray) -> list[str]:
    strongest = [i for i in influences(drawn_of(rows), worse) if abs(i.z) > 2.0][:10]
    return [
        "| imperfection | measure | effect | standard deviations |",
        "|---|---|---|---|",
        *[f"| `{i.name}` | {i.measure} | {i.effect:.2f} | {i.z:+.1f} |" for i in strongest],
    ]


def sensitivity(rows: list[dict]) -> list[str]:
    """Which imperfection kills, and which is only doubted."""
    worse, name = worse_half(rows)
    lines = [
        f"The {name} against the others. Effect: chance that one of them has more of it (0.5: no matter).",
        "",
        *sensitivity_table(rows, worse),
    ]
    upright = [row for row in rows if not row["fell"]]
    doubted = np.array([bool(row.get("excluded_healthy")) for row in upright], dtype=bool)
    if doubted.any() and not doubted.all():
        lines += ["", "Of the upright, those that lost a healthy sensor against the others:", ""]
        lines += sensitivity_table(upright, doubted)
    return lines


def worst_cases(rows: list[dict], settings: dict, how_many: int) -> list[str]:
    worst = sorted((row for row in rows if row["fell"]), key=lambda row: row["fell_at_s"])
    upright = (row for row in rows if not row["fell"])
    worst += sorted(upright, key=lambda row: -(row["attitude_rmse_rad"] or 0.0))
    lines = []
    for row in worst[:how_many]:
        what = f"fell at {row['fell_at_s']:.2f} s ({why(row)})" if row["fell"] else "upright"
        attitude = row["attitude_rmse_rad"]
        errors = "" if row["fell"] or attitude is None else f", attitude {attitude:.4f} rad"
        lines.append(f"- robot {row['robot']}: {what}{errors}: `{replay_command(row, settings)}`")
    return lines


def page(rows: list[dict], settings: dict) -> str:
    robots = len({row["robot"] for row in rows})
    fell = sum(row["fell"] for row in rows)
    lines = [
        "# Campaign",
        f"{len(rows)} trials of {robots} robots drawn from `[population]` of {settings['config']}, world "
        f"`{settings['fidelity']}`{engine_of(settings)}, "
        f"{settings['duration_s']:g} s each; version {settings['version']}. "
        f"{len(rows) - fell} upright to the end, {fell} not.",
        "",
        made_by(rows, settings),
        "",
        *survival_table(rows),
        "",
        "Errors of those upright to the end, after the first 5 s:",
        "",
        *error_table(rows),
        "",
        "![survival](survival.png)",
        "",
    ]
    if fell:
        lines += ["## Why the motors went off", *reasons_table(rows), ""]
    lines += ["## Which imperfection it is", *sensitivity(rows), "", "![sensitivity](sensitivity.png)", ""]
    lines += ["## Worst cases", *worst_cases(rows, settings, WORST)]
    return "\n".join(lines) + "\n"


def write_page(rows: list[dict], settings: dict, out: Path) -> Path:
    draw_pictures(rows, out)
    path = out / "campaign.md"
    path.write_text(page(rows, settings))
    return path
