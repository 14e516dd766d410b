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
from collections import Counter
from functools import cache
from pathlib import Path

from .count_page import (
    MODES,
    PAGE,
    ROBOTS,
    STAGES,
    TABLE,
    TICK_HZ,
    cycle_tables,
    firmware_table,
    table,
    write_page,
)
from .entry import leave
from .paths import UserError, commit_and_date, repository_root

TICKS = (600, 1000)  # after arming, when the isolation's bank runs under suspicion only
STEPS = (200, 600)
INVERSIONS = (6400, 19200)
MODE_TICKS = 800
LOGGED_S = (2, 5)
LOAD_LOG = Path("build/vm/console-load.log")  # what tools/vm-test load leaves
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

    def filters(self, robot: str, part: str, times: int) -> int:
        return _filters([str(self.program), robot, ROBOTS[robot], part, str(times)], self.root)

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

    def filters(self, robot: str, part: str, times: int) -> int:
        command = ["qemu-arm", "-cpu", "cortex-a8", "-L", str(self.sysroot)]
        return _filters([*command, str(self.program), robot, ROBOTS[robot], part, str(times)], self.root)

    def cycles(self, robot: str, part: str, times: int) -> int:
        """How they are taken is said in count_plugin.c."""
        return self._counts(robot, part, times)["cycles"]

    def stages(self, robot: str) -> dict[str, int]:
        """Cycles of an armed tick by stage."""
        per_tick: Counter[str] = Counter()
        for times, sign in zip(TICKS, (-1, 1), strict=True):
            for part, more in (("ticks", sign), ("run", -sign)):
                for name, cycles in by_function(self._said(robot, part, times)).items():
                    per_tick[name] += more * cycles
        return {k: round(v / (TICKS[1] - TICKS[0])) for k, v in stages_of(per_tick).items()}

    def mode(self, robot: str, mode: str) -> dict[str, int]:
        """Mean and most cycles of a tick."""
        found = re.search(r"^tick (\d+) most (\d+)$", self._said(robot, f"mode-{mode}", MODE_TICKS), re.M)
        if found is None:
            raise UserError(f"mode {mode} of {robot} has no ticks")
        return {"mean": int(found[1]), "most": int(found[2])}

    def _counts(self, robot: str, part: str, times: int) -> dict[str, int]:
        found = dict(re.findall(r"^(instructions|cycles) (\d+)$", self._said(robot, part, times), re.M))
        if len(found) != 2:
            raise UserError("qemu-arm's plugin said nothing; is qemu-user built with plugins?")
        return {k: int(v) for k, v in found.items()}

    @cache  # noqa: B019 - one machine per run, and its counts are few
    def _said(self, robot: str, part: str, times: int) -> str:
        command = ["qemu-arm", "-cpu", "cortex-a8", "-L", str(self.sysroot), "-plugin", str(self.plugin)]
        return _run([*command, str(self.program), robot, ROBOTS[robot], part, str(times)], self.root)


def by_function(said: str) -> Counter[str]:
    """Cycles of each function that the plugin named."""
    found = re.findall(r"^function (\d+) (.*)$", said, re.M)
    mangled = "\n".join(name for _, name in found)
    names = subprocess.run(["c++filt"], input=mangled, capture_output=True, text=True, check=True).stdout
    result: Counter[str] = Counter()
    for (cycles, _), name in zip(found, names.splitlines(), strict=True):
        result[name] += int(cycles)
    return result


def stages_of(functions: dict[str, int]) -> dict[str, int]:
    """A function's cycles, with those of what is inlined into it, are its stage's."""
    stages = dict.fromkeys([*STAGES, "libraries", "rest"], 0)
    for name, cycles in functions.items():
        stages[name if name == "libraries" else _stage(_plain(name))] += cycles
    return stages


def _filters(command: list[str], folder: Path) -> int:
    said = re.search(r"^filters (\d+)$", _run(command, folder), re.M)
    if said is None:
        raise UserError(f"{' '.join(command)} did not say how often its filter ran")
    return int(said[1])


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


def costs(machine, robot: str, detector: bool = True) -> dict:
    """Of a tick and its parts; the filter of a tick runs once, and more often while the bank does.

    Not `detector`: without what says how much of it is the detector's."""
    stages = None
    if isinstance(machine, Callgrind):
        stages = tick_profile(machine, robot)
        tick, run, log = stages.pop("total"), stages.pop("run"), machine.log(robot)
    else:
        run = per(machine.total, robot, "run", TICKS)
        tick, log = per(machine.total, robot, "ticks", TICKS) - run, None
    packed = per(machine.total, robot, "packed", STEPS)
    return {
        "tick": tick,
        "filters": per(machine.filters, robot, "filters", TICKS) if detector else None,
        "filter": packed,
        "tick_of_one_filter": alone(machine.total, robot) if detector else None,
        "simulated_tick": run,
        "log": log,
        "stages": stages,
    }


def alone(count, robot: str) -> float:
    """A tick without the detector and its filters."""
    return per(count, robot, "alone-ticks", TICKS) - per(count, robot, "alone-run", TICKS)


def cycles(machine: CortexA8, robot: str, filters: float) -> dict:
    ticks, run = (per(machine.cycles, robot, part, TICKS) for part in ("ticks", "run"))
    packed, dense = (per(machine.cycles, robot, part, STEPS) for part in ("packed", "dense"))
    tick = ticks - run
    dense_tick = tick + filters * (dense - packed)
    bank = tick - alone(machine.cycles, robot)
    return {
        "tick_cycles": round(tick),
        "filter_cycles": round(packed),
        "bank_in_filters": round(bank / packed, 2),
        "dense_filter_cycles": round(dense),
        "dense_tick_cycles": round(dense_tick),
        "cycles_ratio": round(tick / dense_tick, 4),
        "stage_cycles": machine.stages(robot),
        "modes": {mode: machine.mode(robot, mode) for mode in MODES},
    }


def counted(machine) -> dict:
    result: dict = {}
    for robot in ROBOTS:
        cost = costs(machine, robot)
        dense = per(machine.total, robot, "dense", STEPS)
        dense_tick = cost["tick"] + cost["filters"] * (dense - cost["filter"])
        stages = cost.pop("stages")
        result[robot] = {k: v and round(v, 3 if k == "filters" else None) for k, v in cost.items()}
        result[robot] |= {"dense_filter": round(dense), "dense_tick": round(dense_tick)}
        result[robot]["ratio"] = round(cost["tick"] / dense_tick, 4)
        result[robot]["stages"] = stages and {k: round(v) for k, v in stages.items()}
        if isinstance(machine, CortexA8):
            result[robot] |= cycles(machine, robot, cost["filters"])
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


def standing_tick(robot: dict) -> int:
    """Instructions of a tick of a robot that stands, as the emulated one does, by its share of cycles."""
    return round(robot["tick"] * robot["modes"]["standing"]["mean"] / robot["tick_cycles"])


def count_all(root: Path) -> dict:
    result: dict = {"x86": counted(Callgrind(root))}
    with tempfile.TemporaryDirectory() as folder:
        try:
            result["cortex_a8"] = counted(CortexA8(root, folder))
        except UserError as missing:
            result["cortex_a8"] = None
            result["cortex_a8_missing"] = str(missing)
    log = root / LOAD_LOG
    load = firmware_load(log.read_text(encoding="utf-8")) if log.is_file() else None
    if load is None:  # what was counted last
        before = json.loads((root / TABLE).read_text(encoding="utf-8"))
        result |= {k: before[k] for k in ("firmware", "firmware_commit", "firmware_tick")}
    else:
        result["firmware"], (result["firmware_commit"], _) = load, commit_and_date()
        a8 = result["cortex_a8"]
        result["firmware_tick"] = {r: standing_tick(a8[r]) for r in ROBOTS} if a8 else None
    return result


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
            print("\n".join(firmware_table(counts)))
        if counts["cortex_a8"] is None:
            print(f"Cortex-A8: not counted ({counts['cortex_a8_missing']})")
        else:
            print("\n".join(cycle_tables(counts["cortex_a8"])))
    return 0


if __name__ == "__main__":
    leave(main)
