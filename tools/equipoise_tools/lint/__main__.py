"""python -m equipoise_tools.lint [--fix] [CHECK...]: prints findings, exits 1 when there are any."""

from __future__ import annotations

import argparse
import sys

from ..entry import leave
from ..paths import repository_root
from . import analyzers, formatting
from .house import house
from .law import law
from .tidy import clang_tidy
from .tree import tree_of_git
from .words import words

CHECKS = {
    "clang-format": formatting.clang_format,
    "black": formatting.black,
    "ruff": formatting.ruff,
    "shellcheck": formatting.shellcheck,
    "law": law,
    "house": house,
    "words": words,
    "gcc-analyzer": analyzers.gcc_analyzer,
    "cppcheck": analyzers.cppcheck,
    "clang-tidy": clang_tidy,
}
FIXERS = ("clang-format", "ruff", "black")


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/lint", description="Checks the files git knows.")
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=f"{', '.join(CHECKS)} (default: all)")
    parser.add_argument("--fix", action="store_true", help=f"let {', '.join(FIXERS)} rewrite files first")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.checks if name not in CHECKS]
    if unknown:
        parser.error(f"no check is called {unknown[0]}; there are {', '.join(CHECKS)}")
    tree = tree_of_git(repository_root())
    wanted = arguments.checks or list(CHECKS)
    if arguments.fix:
        for name in FIXERS:
            if name in wanted:
                CHECKS[name](tree, fix=True)
    total = 0
    for name in wanted:
        findings = CHECKS[name](tree)
        total += len(findings)
        for finding in findings:
            print(f"{finding} [{name}]")
    print(f"{len(wanted)} checks, {total} findings", file=sys.stderr)
    return 1 if total else 0


if __name__ == "__main__":
    leave(main)
