"""Instructions of the firmware's parts, counted by callgrind and by a qemu plugin; tools/count_instructions.

Every number is the difference of two runs of tests/bench/instruction_count.cpp with another number of
ticks, so that start and configuration are left out.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from .entry import leave
from .paths import UserError, repository_root

ROBOTS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml"}
TICKS = (600, 1000)  # after arming, while the isolation's bank no longer runs
STEPS = (200, 600)
INVERSIONS = (6400, 19200)
LOGGED_S = (2, 5)
TICK_HZ = 200
CLOCK_HZ = 1e9
TABLE = Path("tests/data/instructions.json")
PAGE = Path("docs/performance.md")
LOAD_LOG = Path("build/vm/console-load.log")  # what tools/vm-test load leaves
MOST_LOAD = 0.08  # of 1 GHz, of the whole firmware
# Where a line of the tick belongs: by its file, or, of a call in the tick itself, by the function.
STAGES = {
    "sense": r"/sense/|Senses|attitude_filter",
    "estimate": r"/estimate/|stimators|/ekf\.",
    "reference": r"reference\.[ch]|Reference",
    "control": r"/control/|eedback|friction",
    "bridge": r"bridge|drive_coast|DriveCoast|Bridge|within_supply|allocate",
    "safety": r"safety|Safety|encoder_check|EncoderCheck",
}
NUMBER = re.compile(r"(\+|-)?\d+|\*")


class Callgrind:
    """This machine's processor."""

    def __init__(self, root: Path):
        self.program = root / "build/host/tests/bench/instruction_count"
        self.root = root

    def profile(self, robot: str, part: str, times: int) -> dict[str, int]:
        """Instructions in all, and of the tick by stage."""
        return self._profile([str(self.program), robot, ROBOTS[robot], part, str(times)])

    def _profile(self, command: list[str]) -> dict[str, int]:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "callgrind"
            _run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", *command], self.root)
            return by_stage(out.read_text(encoding="utf-8", errors="replace"))

    def log(self, robot: str) -> float:
        """Of the thread that writes the log, per tick: what a simulation with one costs more."""
        program = str(self.root / "build/host/equipoise")
        command = [program, "sim", "--config", ROBOTS[robot], "--telemetry", "off", "--duration-s"]
        with tempfile.TemporaryDirectory() as folder:
            few, many = (
                self._profile([*command, str(s), "--log", f"{folder}/{s}.lcm"])["total"]
                - self._profile([*command, str(s), "--log", "off"])["total"]
                for s in LOGGED_S
            )
        return (many - few) / ((LOGGED_S[1] - LOGGED_S[0]) * TICK_HZ)

    def total(self, robot: str, part: str, times: int) -> int:
        return self.profile(robot, part, times)["total"]


class CortexA8:
    """qemu-arm, which refuses what a Cortex-A8 cannot, with the counting plugin."""

    def __init__(self, root: Path, folder: str):
        self.root = root
        self.program = root / "build/bbb/tests/bench/instruction_count"
        self.sysroot = root / "build/sysroot"
        if not self.program.is_file():
            raise UserError("no cross compiler or no sysroot; run tools/cross-test once")
        self.plugin = Path(folder) / "count.so"
        source = root / "tests/bench/count_plugin.c"
        _run(["cc", "-O2", "-shared", "-fPIC", "-o", str(self.plugin), str(source)], root)

    def total(self, robot: str, part: str, times: int) -> int:
        return self._counts(robot, part, times)["instructions"]

    def cycles(self, robot: str, part: str, times: int) -> int:
        """How they are taken is said in count_plugin.c."""
        return self._counts(robot, part, times)["cycles"]

    @cache  # noqa: B019 - one machine per run, and its counts are few
    def _counts(self, robot: str, part: str, times: int) -> dict[str, int]:
        command = ["qemu-arm", "-cpu", "cortex-a8", "-L", str(self.sysroot), "-plugin", str(self.plugin)]
        said = _run([*command, str(self.program), robot, ROBOTS[robot], part, str(times)], self.root)
        found = dict(re.findall(r"^(instructions|cycles) (\d+)$", said, re.M))
        if len(found) != 2:
            raise UserError("qemu-arm's plugin said nothing; is qemu-user built with plugins?")
        return {k: int(v) for k, v in found.items()}


def _run(command: list[str], folder: Path) -> str:
    try:
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise UserError(f"{command[0]} is not installed; run tools/count_instructions") from None
    if ended.returncode != 0:
        raise UserError(f"{' '.join(command)} failed:\n{ended.stderr[-2000:]}")
    return ended.stderr


def by_stage(profile: str) -> dict[str, int]:
    """Of a callgrind file: its total, and the cost of the tick by stage, with what is called from there."""
    names: dict[str, dict[str, str]] = {"file": {}, "function": {}}

    def named(kind: str, text: str) -> str:
        key, _, name = text.partition(" ")
        if name:
            names[kind][key] = name
        return names[kind].get(key, text)

    costs = {"total": 0, **dict.fromkeys(STAGES, 0), "rest": 0}
    file = function = callee = callee_file = ""
    call = False
    for line in profile.splitlines():
        key, is_key, value = line.partition("=")
        if is_key and key in ("fl", "fi", "fe"):
            file = named("file", value)
        elif is_key and key == "fn":
            function = named("function", value)
        elif is_key and key == "cfn":
            callee, callee_file = named("function", value), callee_file or file
        elif is_key and key in ("cfi", "cfl"):
            callee_file = named("file", value)
        elif is_key and key == "calls":
            call = True
        elif line.startswith("summary:"):
            costs["total"] = int(line.split()[1])
        elif line and NUMBER.match(line) and not is_key:
            cost = int(line.split()[1])
            if "Pipeline<" in function and "::tick(" in function:
                where = file if "pipeline.hpp" not in file else (_plain(callee) if call else "")
                costs[_stage(where)] += cost
            call, callee_file = False, ""
    return costs


def _plain(function: str) -> str:
    """Without template and other arguments, which name every stage."""
    function = re.sub(r"\(.*", "", function)
    while "<" in function and (shorter := re.sub(r"<[^<>]*>", "", function)) != function:
        function = shorter
    return function


def _stage(where: str) -> str:
    return next((name for name, pattern in STAGES.items() if re.search(pattern, where)), "rest")


def per(count, robot: str, part: str, times: tuple[int, int]) -> float:
    few, many = (count(robot, part, n) for n in times)
    return (many - few) / (times[1] - times[0])


def tick_profile(machine: Callgrind, robot: str) -> dict[str, float]:
    """Of an armed tick, and of a simulated one ("run")."""
    (few, few_run), (many, many_run) = (
        [machine.profile(robot, part, n) for part in ("ticks", "run")] for n in TICKS
    )
    ticks = TICKS[1] - TICKS[0]
    tick = {k: (many[k] - many_run[k] - few[k] + few_run[k]) / ticks for k in many}
    return tick | {"run": (many_run["total"] - few_run["total"]) / ticks}


def counted(machine) -> dict:
    result: dict = {}
    for robot in ROBOTS:
        stages = None
        if isinstance(machine, Callgrind):
            stages = tick_profile(machine, robot)
            tick, run, log = stages.pop("total"), stages.pop("run"), machine.log(robot)
        else:
            run = per(machine.total, robot, "run", TICKS)
            tick, log = per(machine.total, robot, "ticks", TICKS) - run, None
        packed, dense = (per(machine.total, robot, form, STEPS) for form in ("packed", "dense"))
        numbers = {
            "tick": tick,
            "filter": packed,
            "dense_filter": dense,
            "dense_tick": tick - packed + dense,
            "simulated_tick": run,
        }
        result[robot] = {k: round(v) for k, v in numbers.items()}
        result[robot]["ratio"] = round(tick / (tick - packed + dense), 4)
        result[robot]["log"] = log and round(log)
        result[robot]["stages"] = stages and {k: round(v) for k, v in stages.items()}
        if isinstance(machine, CortexA8):
            run_cycles = per(machine.cycles, robot, "run", TICKS)
            result[robot]["tick_cycles"] = round(per(machine.cycles, robot, "ticks", TICKS) - run_cycles)
            result[robot]["filter_cycles"] = round(per(machine.cycles, robot, "packed", STEPS))
    ours, newton = (per(machine.total, "mbbr", how, INVERSIONS) for how in ("bridge", "newton"))
    result["bridge"] = {"inversion": round(ours), "newton": round(newton), "ratio": round(ours / newton, 4)}
    return result


def firmware_load(console: str) -> dict[str, dict[str, int]] | None:
    """Instructions per tick of the whole firmware in the emulated robot, by who took them."""
    found = {}
    for line in console.splitlines():
        if line.startswith('{"instructions"'):
            robot = json.loads(line)
            found[robot["load"]] = {k: round(v) for k, v in robot["instructions"].items()}
    return found if set(found) == set(ROBOTS) else None


def count_all(root: Path) -> dict:
    result: dict = {"x86": counted(Callgrind(root))}
    with tempfile.TemporaryDirectory() as folder:
        try:
            result["cortex_a8"] = counted(CortexA8(root, folder))
        except UserError as missing:
            result["cortex_a8"] = None
            result["cortex_a8_missing"] = str(missing)
    log = root / LOAD_LOG
    result["firmware"] = firmware_load(log.read_text(encoding="utf-8")) if log.is_file() else None
    return result


def table(counts: dict) -> list[str]:
    machines = [
        (name, counts[key]) for key, name in (("x86", "x86-64"), ("cortex_a8", "Cortex-A8")) if counts[key]
    ]
    columns = [(f"{name}, {robot}", m[robot]) for name, m in machines for robot in ROBOTS]
    lines = ["| instructions per tick | " + " | ".join(name for name, _ in columns) + " |"]
    lines += ["|---" * (len(columns) + 1) + "|"]
    rows = [
        ("tick", "tick"),
        ("of it the default filter", "filter"),
        ("the same filter, dense Eigen", "dense_filter"),
        ("tick with the dense filter", "dense_tick"),
        ("tick over that", "ratio"),
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


def a8_load(robots: dict) -> list[str]:
    """What the Cortex-A8's counts mean for its load."""
    cycles = ", ".join(f"{robots[r]['tick_cycles']:,} ({r})" for r in ROBOTS)
    filters = ", ".join(f"{robots[r]['filter_cycles']:,} ({r})" for r in ROBOTS)
    load = ", ".join(f"{robots[r]['tick_cycles'] * TICK_HZ / CLOCK_HZ:.1%} ({r})" for r in ROBOTS)
    return [
        "",
        f"A Cortex-A8 needs about {cycles} cycles for a tick, of them {filters} for the filter; that is "
        f"{load} of 1 GHz at 200 Hz. VFPLite is not pipelined, so that the cycles of its instructions "
        "add up: the upper ends of the ranges for doubles in ARM DDI 0344, Table 16.25 (addition 10, "
        "multiplication 17, division 65). Assumed: a square root 65, other VFP arithmetic 17, 20 for a "
        "comparison's result to reach the integer side, 1 for any other instruction. Computed, not measured "
        "on a board; waiting for memory, devices, kernel, telemetry and log are not in it.",
    ]


def whole_load(firmware: dict, robots: dict) -> dict[str, dict[int, float]]:
    """Of 1 GHz, by the cycles that an instruction is taken to need that is none of the tick's arithmetic."""
    load: dict[str, dict[int, float]] = {}
    for robot in ROBOTS:
        arithmetic = robots[robot]["tick_cycles"] - robots[robot]["tick"]
        instructions = sum(firmware[robot].values())
        load[robot] = {n: (n * instructions + arithmetic) * TICK_HZ / CLOCK_HZ for n in (1, 2)}
    return load


def firmware_table(firmware: dict, robots: dict | None) -> list[str]:
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
    if robots is not None:
        load = whole_load(firmware, robots)
        for n in (1, 2):
            cells = " | ".join(f"{load[r][n]:.1%}" for r in ROBOTS)
            lines.append(
                f"| load of 1 GHz, {n} cycle{'s' if n > 1 else ''} each and the tick's VFP | {cells} |"
            )
    return [
        *lines,
        "",
        "Counted by `./tools/vm-test load`: `equipoise run` with guard, log and telemetry balances a "
        "simulated robot through a PREEMPT_RT kernel for 20 s; the machine's clock counts instructions, so "
        "that the kernel's account of who ran how long is their number. System calls are in the row of who "
        "made them. Not in it: what the simulated robot takes, and what the kernel takes for it while no "
        "firmware runs. To the sum are added the cycles beyond one per instruction that the tick's "
        f"arithmetic takes, from above. Aimed at: {MOST_LOAD:.0%}. Assumed: one cycle for every other "
        "instruction; the last row assumes two, and a board decides between them, as waiting for memory is "
        "not counted. The emulated machine's I2C, GPIO, PWM and counters are simple drivers "
        "(tests/hardware/kernel, gpio-sim); those of the AM335x take more, I2C an interrupt every few bytes. "
        "The log goes to memory, not to an SD card.",
    ]


def write_page(root: Path, counts: dict) -> None:
    from .style import plt  # only this needs Matplotlib

    robots = list(ROBOTS)
    figure, axes = plt.subplots(figsize=(7, 2.8))
    stages = [*STAGES, "rest"]
    left = [0.0] * len(robots)
    for stage in stages:
        width = [counts["x86"][r]["stages"][stage] for r in robots]
        axes.barh(robots, width, left=left, label=stage)
        left = [a + b for a, b in zip(left, width, strict=True)]
    axes.set_xlabel("instructions of an armed tick, x86-64")
    axes.legend(ncols=4, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, 1.3))
    figure.tight_layout()
    figure.savefig(root / "docs/images/tick-stages.svg", metadata={"Date": None})
    plt.close(figure)
    text = [
        "# Instructions of a tick",
        "Written by `./tools/count_instructions --write`: counted, not timed, so that the numbers do not "
        "depend on the load of the machine. x86-64 by callgrind; Cortex-A8 by a plugin of qemu-arm. An armed "
        "tick of the robot as built (world `full`) that turns at 1 Hz; the dense filter is the same model in "
        "`KalmanFilter`, fixed-size Eigen, in the same binary. The tests fail when a count on x86 grows by "
        "more than 3 %.",
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
        text += firmware_table(counts["firmware"], counts["cortex_a8"])
    else:
        text += ["", "The whole firmware: not counted; run `./tools/vm-test load` before."]
    (root / PAGE).write_text("\n".join(text) + "\n", encoding="utf-8")
    (root / TABLE).write_text(json.dumps(counts, indent=1) + "\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/count_instructions", description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="as JSON; -: to stdout")
    parser.add_argument("--write", action="store_true", help=f"{PAGE} and {TABLE}")
    options = parser.parse_args()
    root = repository_root()
    try:
        counts = count_all(root)
        if options.write:
            write_page(root, counts)
    except UserError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    if options.json == "-":
        print(json.dumps(counts))
    elif options.json:
        Path(options.json).write_text(json.dumps(counts) + "\n", encoding="utf-8")
    else:
        print("\n".join(table(counts)))
        if counts["firmware"] is not None:
            print("\n".join(firmware_table(counts["firmware"], counts["cortex_a8"])))
        if counts["cortex_a8"] is None:
            print(f"Cortex-A8: not counted ({counts['cortex_a8_missing']})")
    return 0


if __name__ == "__main__":
    leave(main)
