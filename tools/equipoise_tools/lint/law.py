"""The dependency rules of the modules (docs/contributing.md): who may include whom."""

from __future__ import annotations

import re
from collections.abc import Iterator

from .tree import C_SUFFIXES, Finding, Tree

STAGES = ("sense", "estimate", "control", "actuate")
# What a stage may include of ours besides its folder: values.
STAGE_MAY_INCLUDE = re.compile(r"equipoise/(types|samples|config)\.hpp")
# Files that may include more than one stage folder, and why.
JOINS_STAGES = {
    "include/equipoise/pipeline.hpp": "it is the tick",
    "src/config/common_config.hpp": "it reads every stage's parameters",
    "include/equipoise/plant/world.hpp": "it simulates sensors and motors from their stages' parameters",
}
# A robot composes stages; the application runs the whole.
MAY_JOIN_STAGES = ("src/robots/", "src/app/", "src/main.cpp")
JOINS_CORE_AND_DRIVERS = "src/app/"
THE_LOOP = "include/equipoise/runtime/loop.hpp"
# The loop calls a firmware's tick, which is its pipeline's.
THE_FIRMWARE = "src/app/trial/firmware_of.hpp"
# The C++ library's headers that reach the operating system, block, print or know the time.
OS_HEADERS = re.compile(
    r"thread|mutex|shared_mutex|condition_variable|future|iostream|ostream|istream|fstream|sstream|iomanip"
    r"|filesystem|chrono|csignal|ctime|cstdio|cstdlib|clocale|locale|regex"
)
LIBRARIES_OUTSIDE_CORE = re.compile(r"lcm/.*|toml.*|CLI/.*|nlohmann/.*|sodium.*|equipoise/\w+_t\.hpp")
C_HEADERS_IN_CORE = ("math.h", "stdbool.h", "stdint.h", "stddef.h", "float.h", "arm_neon.h", "xmmintrin.h")

_MODULE = re.compile(r"src/app/(\w+)/")
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', re.M)
_ROBOT_BRANCH = re.compile(
    r"\bif\s*\([^;{}]*\brobot\w*(?:\(\))?\s*[!=]=|\bswitch\s*\([^;{}()]*\brobot\w*(?:\(\))?\s*\)"
)
_COMMENT_OR_STRING = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.S)


def includes(text: str) -> Iterator[tuple[int, str, bool]]:
    """(line, header, in angle brackets) of each include directive."""
    for match in _INCLUDE.finditer(text):
        yield text.count("\n", 0, match.start()) + 1, match[2], match[1] == "<"


def is_core(name: str) -> bool:
    if name.startswith("include/equipoise/"):
        return not name.startswith("include/equipoise/runtime/")
    if re.fullmatch(r"src/robots/\w+/config\.cpp", name):  # a robot's configuration reader
        return False
    return name.startswith(tuple(f"src/{folder}/" for folder in ("robots", "plant", *STAGES)))


def stage_of(name: str) -> str | None:
    """The stage that a file belongs to, if any."""
    match = re.match(rf"(?:include/equipoise|src)/({'|'.join(STAGES)})/", name)
    return match[1] if match else None


def stage_included(header: str) -> str | None:
    match = re.match(rf"equipoise/({'|'.join(STAGES)})/", header)
    return match[1] if match else None


def is_driver_header(header: str, drivers: set[str]) -> bool:
    return header.startswith("drivers/") or header in drivers


def outside_core(header: str, angle: bool, drivers: set[str]) -> str | None:
    """Why core may not include this header; None when it may."""
    if is_driver_header(header, drivers):
        return "core never includes drivers"
    if LIBRARIES_OUTSIDE_CORE.fullmatch(header):
        return "core is C++17 on Eigen: no LCM, configuration or command-line library"
    if header.startswith(("equipoise/runtime/", "runtime/", "app/", "config/")):
        return "core never includes the runtime or the application"
    c_header = header.endswith(".h") and header not in C_HEADERS_IN_CORE
    if angle and (OS_HEADERS.fullmatch(header) or c_header):
        return "core never includes headers of the operating system"
    return None


def check_includes(tree: Tree) -> list[Finding]:
    findings = []
    sources = [name for name in tree.ending(*C_SUFFIXES) if name.startswith(("include/", "src/"))]
    drivers = {name.removeprefix("drivers/") for name in tree.ending(".h") if name.startswith("drivers/")}
    for name in sources:
        own = stage_of(name)
        stages_joined = {own} if own else set()
        for line, header, angle in includes(tree.text(name)):
            reason = outside_core(header, angle, drivers) if is_core(name) else None
            if reason:
                findings.append(Finding(name, line, f"includes {header}: {reason}"))
            elif is_driver_header(header, drivers) and not name.startswith(JOINS_CORE_AND_DRIVERS):
                findings.append(
                    Finding(name, line, f"includes {header}: only src/app joins core and drivers")
                )
            stage = stage_included(header)
            if own and not angle and stage != own and not STAGE_MAY_INCLUDE.fullmatch(header):
                message = f"includes {header}: a stage knows types, samples, robots and its own folder"
                findings.append(Finding(name, line, message))
            elif stage and not name.startswith(MAY_JOIN_STAGES) and name not in JOINS_STAGES:
                stages_joined.add(stage)
                if len(stages_joined) == 2:
                    findings.append(Finding(name, line, f"includes {header}: only pipeline.hpp joins stages"))
    return findings


def check_robot_switch(tree: Tree) -> list[Finding]:
    """Robots differ by composition; their names are compared in one file of the application only."""
    found = []
    for name in tree.ending(".cpp", ".hpp"):
        if not name.startswith(("include/", "src/")):
            continue
        code = _COMMENT_OR_STRING.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), tree.text(name))
        for match in _ROBOT_BRANCH.finditer(code):
            found.append(Finding(name, code.count("\n", 0, match.start()) + 1, "branches on the robot"))
    at_home = sorted(
        {finding.path for finding in found if finding.path.startswith(("src/app/", "src/main.cpp"))}
    )
    return [finding for finding in found if finding.path not in at_home[:1]]


def check_one_loop(tree: Tree) -> list[Finding]:
    """What is tested is what runs: only the loop calls a pipeline's tick."""
    findings = []
    for name in tree.ending(".cpp", ".hpp"):
        if not name.startswith(("include/", "src/", "tests/")) or name in (THE_LOOP, THE_FIRMWARE):
            continue
        code = _COMMENT_OR_STRING.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), tree.text(name))
        findings += [
            Finding(name, code.count("\n", 0, match.start()) + 1, f"calls tick: only {THE_LOOP} does")
            for match in re.finditer(r"(?:\.|->)tick\(", code)
        ]
    return findings


def check_module_cycles(tree: Tree) -> list[Finding]:
    """No folder of the application depends on one that depends on it."""
    uses: dict[str, dict[str, Finding]] = {}
    for name in tree.ending(".cpp", ".hpp"):
        if not (module := _MODULE.match(name)):
            continue
        for line, header, _ in includes(tree.text(name)):
            other = _MODULE.match("src/" + header)
            if other and other[1] != module[1]:
                found = Finding(name, line, f"includes {header}: {other[1]} depends on {module[1]}")
                uses.setdefault(module[1], {}).setdefault(other[1], found)

    def reaches(start: str, goal: str) -> bool:
        seen, left = set(), [start]
        while left:
            module = left.pop()
            if module == goal:
                return True
            if module not in seen:
                seen.add(module)
                left += uses.get(module, {})
        return False

    return [
        found for module, others in uses.items() for other, found in others.items() if reaches(other, module)
    ]


def law(tree: Tree) -> list[Finding]:
    return check_includes(tree) + check_robot_switch(tree) + check_one_loop(tree) + check_module_cycles(tree)
