"""What tools/count_instructions writes: docs/performance.md with its picture, and the committed counts."""

from __future__ import annotations

import json
from pathlib import Path

ROBOTS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml"}
TICK_HZ = 200
CLOCK_HZ = 1e9
LONGEST_TICK_S = 2e-3  # at CLOCK_HZ, in every mode: the guard waits for three silent ticks
TABLE = Path("tests/data/instructions.json")
PRECISION = Path("tests/data/precision.json")  # of equipoise_tools.precision
PAGE = Path("docs/performance.md")
MOST_LOAD = 0.09  # of 1 GHz, of the whole firmware
# Of an instruction outside the tick: LMBench's primitives in the emulated kernel, counted, against the times
# published for this chip, take 1.7 to 3.8.
CYCLES_OUTSIDE = (2, 3, 4)
# Where a line of the tick belongs: by its file, or, of a call in the tick itself, by the function.
STAGES = {
    "sense": r"/sense/|Senses|attitude_filter",
    "estimate": r"/estimate/|stimators|/ekf\.|Ekf|Filter|downdate|correct|Watch|Isolation",
    "reference": r"reference\.[ch]|Reference",
    "control": r"/control/|eedback|friction",
    "bridge": r"bridge|drive_coast|DriveCoast|Bridge|within_supply|allocate",
    "safety": r"safety|Safety|encoder_check|EncoderCheck",
}

# Of tests/bench/instruction_count.cpp.
MODES = {
    "disarmed": "motors off",
    "arming": "from arming on",
    "standing": "standing",
    "driving": "driving, 0.2 m/s",
    "turning": "turning, 1 Hz",
    "fast": "turning, 3 Hz, and driving, 0.1 m/s",
    "stall": "13 ticks missed, then caught up",
    "no_imu": "without IMU samples",
    "encoder": "an encoder stops counting",
    "gyro": "a gyro axis stands still",
}


def table(counts: dict) -> list[str]:
    machines = [
        (name, counts[key]) for key, name in (("x86", "x86-64"), ("cortex_a8", "Cortex-A8")) if counts[key]
    ]
    columns = [(f"{name}, {robot}", m[robot]) for name, m in machines for robot in ROBOTS]
    lines = ["| instructions per tick | " + " | ".join(name for name, _ in columns) + " |"]
    lines += ["|---" * (len(columns) + 1) + "|"]
    rows = [
        ("tick", "tick"),
        ("filters that ran in it", "filters"),
        ("the default filter", "filter"),
        ("the same filter, dense Eigen", "dense_filter"),
        ("tick with dense filters", "dense_tick"),
        ("tick over that", "ratio"),
        ("tick without the bank", "tick_of_one_filter"),
        ("log of a tick, another thread", "log"),
        ("simulated tick: plant, sensors, tick", "simulated_tick"),
    ]
    for label, key in rows:
        cells = ["" if c[key] is None else f"{c[key]:,}" for _, c in columns]
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    for stage in [*STAGES, "rest"]:
        cells = [f"{c['stages'][stage]:,}" if c["stages"] else "" for _, c in columns]
        lines.append(f"| stage: {stage} | " + " | ".join(cells) + " |")
    lines += ["", "| instructions per inversion of the bridge | " + " | ".join(n for n, _ in machines) + " |"]
    lines += ["|---" * (len(machines) + 1) + "|"]
    for label, key in (
        ("ours", "inversion"),
        ("Newton from the printed start", "newton"),
        ("ratio", "ratio"),
    ):
        lines.append(f"| {label} | " + " | ".join(f"{m['bridge'][key]:,}" for _, m in machines) + " |")
    return lines


def cycle_tables(robots: dict) -> list[str]:
    """The Cortex-A8's cycles: of a tick by stage, and of the longest tick of every mode."""

    def row(label: str, cell) -> str:
        return f"| {label} | " + " | ".join(cell(robots[r]) for r in ROBOTS) + " |"

    return [
        "",
        "## Cycles of a Cortex-A8",
        "| cycles per tick, turning at 1 Hz | mbbr | mip |",
        "|---|---|---|",
        row("tick", lambda r: f"{r['tick_cycles']:,}"),
        row("the default filter", lambda r: f"{r['filter_cycles']:,}"),
        row("all hypotheses, in such filters", lambda r: f"{r['bank_in_filters']:.1f}"),
        row("the same filter, dense Eigen, double", lambda r: f"{r['dense_filter_cycles']:,}"),
        row("tick with dense filters", lambda r: f"{r['dense_tick_cycles']:,}"),
        row("tick over that", lambda r: f"{r['cycles_ratio']:.4f}"),
        row("load of 1 GHz by the tick", lambda r: f"{r['tick_cycles'] * TICK_HZ / CLOCK_HZ:.1%}"),
        *(
            row(f"stage: {stage}", lambda r, stage=stage: f"{r['stage_cycles'][stage]:,}")
            for stage in robots["mbbr"]["stage_cycles"]
        ),
        "",
        "| cycles of a tick: mean, longest | mbbr | mip |",
        "|---|---|---|",
        *(
            row(label, lambda r, mode=mode: f"{r['modes'][mode]['mean']:,}, {r['modes'][mode]['most']:,}")
            for mode, label in MODES.items()
        ),
        "",
        f"No tick of any mode may take more than {LONGEST_TICK_S * 1e3:g} ms at 1 GHz, also one that catches "
        "up: tests/python/test_count_instructions.py. Longest of all: "
        + ", ".join(
            f"{max(m['most'] for m in robots[r]['modes'].values()) / CLOCK_HZ * 1e3:.2f} ms ({r})"
            for r in ROBOTS
        )
        + ".",
    ]


def a8_load(robots: dict) -> list[str]:
    """How the Cortex-A8's cycles are taken."""
    return [
        *cycle_tables(robots),
        "",
        "A function's cycles belong to its stage with what the compiler has inlined into it; libraries: "
        "sine, exponential, copies. VFPLite is not pipelined, so that the cycles of its instructions "
        "add up: the upper ends of the ranges in ARM DDI 0344, Table 16.25 (of doubles: addition 10, "
        "multiplication 17, with a sum 26, division 65). NEON starts an instruction a cycle and waits for "
        "results, 5 cycles or 9 of a multiplication with a sum, as in GCC's cortex-a8-neon.md. A register to "
        "or from memory 4, the one fitted number; 20 for a result to reach the integer side; 1 "
        "for any other instruction. So counted, Linpack and NBench are within 3 to 10 % of what is published "
        "for an AM335x at 1 GHz. Caches are warm; devices, kernel, telemetry and log are not in it.",
    ]


def whole_load(firmware: dict, ticks: dict, robots: dict) -> dict[str, dict[int, float]]:
    """Of 1 GHz, by the cycles that an instruction outside the tick is taken to need. `ticks`: instructions of
    those that the firmware was counted with."""
    load: dict[str, dict[int, float]] = {}
    for robot in ROBOTS:
        cycles, outside = robots[robot]["tick_cycles"], sum(firmware[robot].values()) - ticks[robot]
        load[robot] = {n: (n * outside + cycles) * TICK_HZ / CLOCK_HZ for n in CYCLES_OUTSIDE}
    return load


def firmware_table(counts: dict) -> list[str]:
    firmware, robots = counts["firmware"], counts["cortex_a8"]
    lines = [
        "",
        "## The whole firmware",
        "| instructions per tick, emulated robot | mbbr | mip |",
        "|---|---|---|",
    ]
    rows = [
        ("loop: drivers, tick, hand-over", "loop"),
        ("log and telemetry", "threads"),
        ("guard", "guard"),
        ("kernel beside them: interrupts, timers, its own threads", "kernel"),
    ]
    for label, key in rows:
        lines.append(f"| {label} | " + " | ".join(f"{firmware[r][key]:,}" for r in ROBOTS) + " |")
    lines.append("| sum | " + " | ".join(f"{sum(firmware[r].values()):,}" for r in ROBOTS) + " |")
    if robots is not None and counts["firmware_tick"] is not None:
        load = whole_load(firmware, counts["firmware_tick"], robots)
        for n in CYCLES_OUTSIDE:
            cells = " | ".join(f"{load[r][n]:.1%}" for r in ROBOTS)
            lines.append(f"| load of 1 GHz, {n} cycles for an instruction outside the tick | {cells} |")
    return [
        *lines,
        "",
        f"Counted at {counts['firmware_commit']} by `./tools/vm-test load`: `equipoise run` with guard, log "
        "and telemetry balances a simulated robot through a PREEMPT_RT kernel for 20 s; the machine's clock "
        "counts instructions, so that the kernel's account of who ran how long is their number. System "
        "calls are in the row of who "
        "made them. Not in it: what the simulated robot takes, and what the kernel takes for it while no "
        f"firmware runs. The tick's cycles are those above. Aimed at: {MOST_LOAD:.0%}, with 3 cycles for an "
        "instruction outside it: LMBench's primitives in the emulated kernel, counted, against the times "
        "published for this chip, take 1.7 to 3.8. A board decides. The emulated machine's I2C, GPIO, PWM "
        "and counters are simple drivers "
        "(tests/hardware/kernel, gpio-sim); those of the AM335x take more, I2C an interrupt every few bytes. "
        "The log goes to memory, not to an SD card.",
    ]


def precision_table(found: dict) -> list[str]:
    """Errors of single over double precision."""

    def interval(middle: float, low: float, high: float) -> str:
        return f"{middle:+.2%} [{low:+.2%}, {high:+.2%}]"

    def row(label: str, cell) -> str:
        return f"| {label} | " + " | ".join(cell(found[r]) for r in ROBOTS) + " |"

    lines = [
        "",
        "## Single and double precision",
        "| single over double, less 1 | mbbr | mip |",
        "|---|---|---|",
    ]
    for key, name in (
        ("attitude_rmse_rad", "attitude"),
        ("yaw_frame_speed_rmse_m_s", "speed in the yaw frame"),
    ):
        for share, which in (("0.5", "median"), ("0.95", "95th percentile")):
            lines.append(row(f"{name}, {which}", lambda r, k=key, s=share: interval(*r[k][s])))
        lines.append(
            row(f"{name}, median of a robot's ratio", lambda r, k=key: f"{r[k]['ratio_median']:+.2%}")
        )
    ends = "finished: single, double, both"
    lines.append(
        row(ends, lambda r: ", ".join(f"{r['finished'][k]:,}" for k in ("single", "double", "both")))
    )
    return [
        *lines,
        "",
        f"RMSE over {found['robots']:,} robots of each type ({found['first']} on, a seed each), world "
        f"`{found['fidelity']}`, {found['duration_s']:g} s, a third each at 0, 1 and 2 Hz, half of them at "
        "0.1 m/s, once in each precision: `python -m equipoise_tools.precision --write`. Brackets: 95 % of "
        "resampled robots. A closed loop amplifies the last digit (a count that falls into the next tick, a "
        "wheel that sticks), so that single runs of any two arithmetically different builds differ.",
    ]


def write_page(root: Path, counts: dict) -> None:
    (root / TABLE).write_text(json.dumps(counts, indent=1) + "\n", encoding="utf-8")
    draw_stages(root, counts)
    (root / PAGE).write_text(performance_page(root), encoding="utf-8")


def draw_stages(root: Path, counts: dict) -> None:
    from . import style  # only this needs Matplotlib

    robots = list(ROBOTS)
    text = {"svg.fonttype": "none", "svg.hashsalt": "tick-stages"}
    with style.styled(), style.plt.rc_context(text):
        figure, axes = style.plt.subplots(figsize=(7, 2.8))
        left = [0.0] * len(robots)
        for i, stage in enumerate((*STAGES, "rest")):
            width = [counts["x86"][r]["stages"][stage] for r in robots]
            axes.barh(robots, width, left=left, label=stage, color=style.colour(i), zorder=2)
            left = [a + b for a, b in zip(left, width, strict=True)]
        axes.set_xlabel("instructions of an armed tick, x86-64")
        axes.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.3))
        figure.tight_layout()
        figure.savefig(root / "docs/images/tick-stages.svg", metadata={"Date": None})
        style.plt.close(figure)


def performance_page(root: Path) -> str:
    """Of the committed numbers."""
    counts = json.loads((root / TABLE).read_text(encoding="utf-8"))
    text = [
        "# Instructions of a tick",
        "Written by `./tools/count_instructions --write`: counted, not timed, so that the numbers do not "
        "depend on the load of the machine. x86-64 by callgrind; Cortex-A8 by a plugin of qemu-arm. An armed "
        "tick of the robot as built (world `built2025`) turning at 1 Hz; the dense filter is the same "
        "model in `KalmanFilter`, fixed-size Eigen, in the same binary. The detector runs a filter per "
        "hypothesis that it cannot refute without (sensor_faults.hpp): how many ran in a tick is counted, "
        "too, and each is a dense one in the dense tick. tools/test fails when a count on x86 grows by more "
        "than 3 %, tools/cross-test when one on the Cortex-A8 does.",
        "",
        *table(counts),
        "",
        "![Stages of a tick](images/tick-stages.svg)",
    ]
    if counts["cortex_a8"] is not None:
        text += a8_load(counts["cortex_a8"])
    else:
        text += ["", f"Cortex-A8: not counted ({counts['cortex_a8_missing']})."]
    if counts["firmware"] is not None:
        text += firmware_table(counts)
    else:
        text += ["", "The whole firmware: not counted; run `./tools/vm-test load` before."]
    if (root / PRECISION).is_file():
        text += precision_table(json.loads((root / PRECISION).read_text(encoding="utf-8")))
    return "\n".join(text) + "\n"
