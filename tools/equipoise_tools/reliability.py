"""docs/reports/reliability.md: what was promised about faults, deadlines and data, and what was measured."""

from __future__ import annotations

import argparse
import hashlib
import inspect
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from datetime import date

from .entry import leave
from .reliability_faults import faults
from .reliability_part import BINARY, BUILD, ROOT, Part, isolated, output
from .reliability_population import population

PAGE = ROOT / "docs" / "reports" / "reliability.md"
GUARD_LIMIT_MS = 15.0
WAKE_RATIO_LIMIT = 1.1
FUZZ_EXECUTIONS = 10_000_000


def runtime_tests(filter_: str) -> str:
    return output(BUILD / "tests/runtime/runtime_tests", f"--gtest_filter={filter_}")


def load() -> str:
    return f"load {os.getloadavg()[0]:.1f}"


def guard(_: argparse.Namespace) -> Part:
    text = runtime_tests("GuardProcess.*")
    # A time without real-time priority is no evidence: the test says so by skipping itself.
    skipped = "no real-time priority here" in text
    rows = [
        (
            f"guard: off after {what}, from the last beat, the worst of 10",
            f"≤ {GUARD_LIMIT_MS:.0f} ms",
            f"{ms} ms, {load()}",
            None if skipped else float(ms) <= GUARD_LIMIT_MS,
        )
        for ms, what in re.findall(r"^off (\S+) ms after (.*)$", text, re.M)
    ]
    return Part(rows or [("guard: off in time", f"≤ {GUARD_LIMIT_MS:.0f} ms", "not measured", False)])


def tick(_: argparse.Namespace) -> Part:
    text = runtime_tests("*Tick*.*")
    part = Part()
    for test, what in (
        ("AllocatesNothing", "allocations in a tick"),
        ("MakesNoSystemCall", "system calls in the pipeline's tick (seccomp)"),
    ):
        passed, skipped = (
            len(re.findall(rf"^\[ +{how} \] .*{test}/", text, re.M)) for how in ("OK", "SKIPPED")
        )
        measured = f"0 in {passed} test runs" + (f", {skipped} skipped" if skipped else "")
        part.rows.append((what, "0", measured, None if skipped else passed > 0))
    return part


def traced(console: str) -> tuple[str, str, str, bool]:
    """The row of what the emulated robot's kernel traced, from its console."""
    found = re.search(r"^trace: (\d+) ticks, at most (\d+) system calls in one, (\d+) sleeps", console, re.M)
    ticks, most, sleeps = map(int, found.groups()) if found else (0, 0, 0)
    passed = re.search(r"^\[ +OK \] (\S+/)?ClosedLoop\.InATickOnlyTheDrivers", console, re.M) is not None
    return (
        "system calls of a whole tick, kernel's trace",
        "the drivers' only, 0 that block",
        (
            f"{ticks} ticks of the emulated robot: at most {most}, drivers' only; {sleeps} blocked"
            if passed
            else "not measured: the test failed"
        ),
        passed and ticks > 0 and sleeps == 0,
    )


def trace(_: argparse.Namespace) -> Part:
    output(ROOT / "tools/vm-test", "robot", check=False)
    return Part([traced((ROOT / "build/vm/console-bbb.log").read_text(errors="replace"))])


def sandbox(_: argparse.Namespace) -> Part:
    text = output(
        "systemd-analyze", "security", "--offline=yes", "--no-pager", ROOT / "packaging/equipoise.service"
    )
    exposure = float(re.findall(r"exposure level for \S+: (\S+)", text)[-1])
    return Part(
        [
            (
                "service's sandbox",
                "exposure below 4.0",
                f"{exposure} (systemd-analyze security)",
                exposure < 4.0,
            )
        ]
    )


def quantiles_us(text: str) -> dict[str, float]:
    """Of cyclictest's histogram."""
    bins = [tuple(map(int, line.split())) for line in text.splitlines() if re.match(r"^\d{6} \d+", line)]
    total = sum(count for _, count in bins)
    quantiles, seen = {}, 0
    for late_us, count in bins:
        seen += count
        for name, share in (("p50_us", 0.5), ("p99_us", 0.99)):
            if name not in quantiles and seen >= share * total:
                quantiles[name] = float(late_us)
    return quantiles


def wake(_: argparse.Namespace) -> Part:
    rounds, loops = 7, 800
    ours, theirs = [], []
    for _ in range(rounds):
        # Beside each other: both meet the same neighbours.
        beside = ["cyclictest", "-q", "-m", "-t1", "-p80", "-i5000", "-l", str(2 * loops), "-h", "20000"]
        with subprocess.Popen(beside, stdout=subprocess.PIPE, text=True) as other:
            told = json.loads(output(BINARY, "bench", "--json", "-", "--ticks", 200, "--wakes", loops))
            theirs.append(quantiles_us(other.communicate()[0]))
        ours.append(told["wake"]["loop"])
    part = Part()
    for name in ("p50_us", "p99_us"):
        a, b = (statistics.median(round_[name] for round_ in runs) for runs in (ours, theirs))
        part.rows.append(
            (
                f"wake-up {name[:3]} against cyclictest",
                f"≤ {WAKE_RATIO_LIMIT} ×",
                f"{a:.0f} µs against {b:.0f} µs: {a / b:.2f} × (medians of {rounds} runs beside it)",
                a <= WAKE_RATIO_LIMIT * b,
            )
        )
    return part


def fuzz(options: argparse.Namespace) -> Part:
    limit = ("--runs", options.fuzz_runs)
    text = output(ROOT / "tools/fuzz", *limit, check=False)
    part = Part()
    for target, executions in re.findall(r"^(\w+) +(\d+) executions, no finding$", text, re.M):
        holds = int(executions) >= FUZZ_EXECUTIONS
        wanted = f"{FUZZ_EXECUTIONS:.0e} executions, no finding"
        part.rows.append((f"fuzzing: {target}", wanted, f"{int(executions):.2e}, no finding", holds))
    for target in re.findall(r"^(\w+) +FINDING", text, re.M):
        part.rows.append((f"fuzzing: {target}", "no finding", "a finding", False))
    if not part.rows:
        part.rows.append(("fuzzing", "no finding", "not measured: tools/fuzz failed", False))
    return part


def commands(_: argparse.Namespace) -> Part:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}/tools:{ROOT}/python:{BUILD}/lcm/python"}
    part = Part()
    with tempfile.TemporaryDirectory() as folder:
        run = (sys.executable, ROOT / "tests/python/command_run.py", BINARY, ROOT / "config/mbbr.toml")
        told = json.loads(output(*isolated(*run, folder), env=environment))
    measured = f"{told['attacks']} sent, {told['accepted']} accepted"
    holds = told["attacks"] >= 1000 and told["accepted"] == 0
    part.rows.append(("forged and replayed commands, LCM", "1000 sent, 0 accepted", measured, holds))
    for wire in ("lcm", "serial"):
        with tempfile.TemporaryDirectory() as folder:
            attacks = (sys.executable, ROOT / "tests/security/attacks.py", BINARY, ROOT / "config/mbbr.toml")
            played = json.loads(output(*isolated(*attacks, folder, wire), env=environment))
        seen = [as_expected for attack in played.values() for as_expected in attack.values()]
        measured = f"{len(played)} attacks, {len(seen)} outcomes, {seen.count(False)} wrong"
        what = "the real program attacked (tests/security/attacks.py), " + {"lcm": "LCM"}.get(
            wire, "serial line"
        )
        part.rows.append((what, "0 wrong outcomes", measured, len(played) >= 7 and all(seen)))
    text = output(sys.executable, "-m", "pytest", "-q", "tests/security/test_protocol_model.py", check=False)
    passed, failed = (
        int(m[1]) if (m := re.search(rf"(\d+) {how}", text)) else 0 for how in ("passed", "failed")
    )
    measured = f"{passed} searches as expected, {failed} not"
    part.rows.append(
        ("every reachable state of the protocol's model", "no attack", measured, failed == 0 < passed)
    )
    return part


def pytest_output(file: str, pattern: str) -> str:
    command = (sys.executable, "-m", "pytest", "-q", "-s", f"tests/python/{file}.py", "-k", pattern)
    return output(*isolated(*command), check=False)


def blackbox(_: argparse.Namespace) -> Part:
    part = Part()
    told = re.findall(
        r"^\.?(\d+) kills under load (\d+): at most (\S+) ms lost, mean (\S+) ms",
        pytest_output("test_blackbox_killed", "sigkill"),
        re.M,
    )
    for wanted, under in ((200, "0"), (40, "10")):
        what = f"SIGKILL at random times, {f'{under} busy processes beside it' if int(under) else 'alone'}"
        rows = [row for row in told if row[1] == under]
        measured = "not measured"
        if rows:
            measured = f"{rows[0][0]} readable logs, at most {rows[0][2]} ms lost, mean {rows[0][3]} ms"
        holds = bool(rows) and int(rows[0][0]) >= wanted and float(rows[0][2]) <= 100.0
        part.rows.append((what, f"{wanted} readable logs, ≤ 100 ms lost", measured, holds))
    replayed = re.search(r"(\d+) passed", pytest_output("test_blackbox", "replays_bit_for_bit"))
    scenarios = int(replayed[1]) if replayed else 0
    part.rows.append(
        ("bit-exact replay", "every scenario", f"{scenarios} scenarios, all identical", scenarios > 0)
    )
    return part


def sanitizers(_: argparse.Namespace) -> Part:
    part = Part()
    for preset, what in (
        ("sanitize", "AddressSanitizer, UndefinedBehaviorSanitizer"),
        ("tsan", "ThreadSanitizer"),
    ):
        targets = ("unit_tests", "app_tests", "driver_tests", "runtime_tests", "equipoise")
        output("cmake", "--preset", preset)
        output("cmake", "--build", f"build/{preset}", "--target", *targets)
        filter_ = "--label-regex", "unit|drivers|runtime"
        text = output(*isolated("ctest", "--preset", preset, "-j", os.cpu_count(), *filter_), check=False)
        found = re.search(r"(\d+)% tests passed, (\d+) tests failed out of (\d+)", text)
        failed, total = (int(found[2]), int(found[3])) if found else (1, 0)
        measured = f"{total} tests, {failed} failed"
        part.rows.append((f"{what}: unit, driver and runtime tests", "clean", measured, failed == 0 < total))
    return part


PARTS: dict[str, Callable[[argparse.Namespace], Part]] = {
    "faults": faults,
    "population": population,
    "guard": guard,
    "tick": tick,
    "trace": trace,
    "wake": wake,
    "commands": commands,
    "sandbox": sandbox,
    "blackbox": blackbox,
    "fuzz": fuzz,
    "sanitizers": sanitizers,
}


FIRMWARE = (
    "src",
    "include",
    "drivers",
    "config",
    "lcm",
    "cmake",
    "CMakeLists.txt",
    "CMakePresets.json",
    "packaging",
)
# Parts that run the program alone; the others run tests of it, too.
PROGRAM_ALONE = ("faults", "population", "wake", "sandbox")


OPTIONS = {"faults": ("soak_hours",), "population": ("robots",), "fuzz": ("fuzz_runs",)}  # that a part heeds


def source(name: str) -> str:
    """What the code was that a part measures, and how; empty when that cannot be said."""
    paths = [*FIRMWARE, *(() if name in PROGRAM_ALONE else ("tests", "tools"))]
    state = output("git", "status", "--porcelain", "--", *paths, check=False)
    trees = output("git", "ls-tree", "-r", "HEAD", "--", *paths, check=False)
    part = PARTS[name]
    how = inspect.getsource(part if part.__module__ == __name__ else sys.modules[part.__module__])
    return "" if state or not trees else hashlib.sha256((trees + how).encode()).hexdigest()


def measure(name: str, options: argparse.Namespace) -> Part:
    """Kept in build/reliability, so that hours of measuring survive an interruption."""
    kept = ROOT / "build" / "reliability" / f"{name}.json"
    key = [source(name), *(getattr(options, option) for option in OPTIONS.get(name, ()))]
    if options.resume and key[0] and kept.is_file():
        told = json.loads(kept.read_text())
        if told["key"] == key:
            return Part([tuple(row) for row in told["rows"]], told["section"])
    part = PARTS[name](options)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"key": key, **asdict(part)}))
    return part


HOLDS = {True: "yes", False: "**no**", None: "skipped: no evidence here"}
HEAD = """# Reliability
Written by `tools/reliability`{arguments} at {commit}, {date}, {cpus} CPUs. Faults enter at the hardware
boundary (src/app/io/fault_backend.hpp), in simulated time, world of nominal fidelity, default estimator and
controller. Unsafe is: duty after the deadline of the fault, motors on after a fall, a wrong tilt that is not
noticed, faster than 0.6 m/s or half a metre of unasked travel with motors on, motors off without a reason,
arming by itself: judged in every tick by the plant's truth (src/app/evaluate/fault_run.hpp). Ticks are 5 ms,
count from the first faulty one. Times are of this machine, not of a BeagleBone. Which one-token changes of
this code the tests notice: [mutation testing](mutation.md).

| what | required | measured | holds |
|---|---|---|---|
"""


def main() -> int:
    told = "Writes docs/reports/reliability.md."
    parser = argparse.ArgumentParser(prog="tools/reliability", description=told)
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"only these: {', '.join(PARTS)}; prints them"
    )
    parser.add_argument(
        "--soak-hours", type=float, default=10.0, help="of robot time, per robot (default 10)"
    )
    parser.add_argument("--robots", type=int, default=50, help="of the population (default 50)")
    parser.add_argument(
        "--fuzz-runs", type=int, default=FUZZ_EXECUTIONS, help="per target (default 10 million)"
    )
    parser.add_argument(
        "--skip", action="append", default=[], choices=PARTS, help="leave this part out; the page says so"
    )
    parser.add_argument(
        "--resume", action="store_true", help="keep what was measured before of the very same code"
    )
    options = parser.parse_args()
    unknown = [name for name in options.parts if name not in PARTS]
    if unknown:
        parser.error(f"no part {', '.join(unknown)}; there are: {', '.join(PARTS)}")
    rows, sections = [], []
    for name in options.parts or [name for name in PARTS if name not in options.skip]:
        print(f"{name} ...", file=sys.stderr, flush=True)
        part = measure(name, options)
        rows += part.rows
        sections.append(part.section)
        for row in part.rows:
            print("  " + " | ".join(map(str, row)), file=sys.stderr, flush=True)
    table = "".join(f"| {what} | {wanted} | {got} | {HOLDS[ok]} |\n" for what, wanted, got, ok in rows)
    arguments = "".join(f" {argument}" for argument in sys.argv[1:] if argument != "--resume")
    head = HEAD.format(
        arguments=arguments,
        commit=output("git", "describe", "--always", "--dirty").strip(),
        date=date.today(),
        cpus=os.cpu_count(),
    )
    left_out = f"\nNot measured this time: {', '.join(options.skip)}.\n" if options.skip else ""
    page = head + table + left_out + "\n" + "\n".join(section for section in sections if section)
    if options.parts:
        print(page)
    else:
        PAGE.write_text(page.rstrip() + "\n")
    return 1 if any(ok is False for *_, ok in rows) else 0


if __name__ == "__main__":
    leave(main)
