"""Static analysis beyond clang-tidy: GCC's path analyzer on the C drivers, cppcheck on everything."""

from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from .formatting import findings_at, missing
from .tree import Finding, Tree


def _analyse(tree: Tree, name: str) -> list[Finding]:
    command = ["gcc", "-std=gnu11", "-fanalyzer", "-Idrivers", "-c", "-o", "/dev/null", name]
    result = subprocess.run(command, cwd=tree.root, capture_output=True, text=True)
    return [f for f in findings_at(result.stderr) if f.message.startswith(("warning:", "error:"))]


def gcc_analyzer(tree: Tree) -> list[Finding]:
    names = [name for name in tree.ending(".c") if name.startswith("drivers/")]
    with ThreadPoolExecutor() as pool:
        return [finding for found in pool.map(partial(_analyse, tree), names) for finding in found]


def cppcheck(tree: Tree) -> list[Finding]:
    names = [name for name in tree.ending(".c", ".cpp") if name.startswith(("drivers/", "src/"))]
    if shutil.which("cppcheck") is None:
        return missing("cppcheck")
    command = ["cppcheck", "--quiet", "-j2", "--enable=warning,portability,performance", "--inline-suppr"]
    # As this machine compiles it: beside include guards the preprocessor decides on vector instructions
    # only, and each further configuration takes as long again.
    command += ["-D__SSE2__", "-D__x86_64__"]
    # Its parser gives up on some of C++17, which is no finding about the source.
    command += ["--suppress=internalAstError", "--template={file}:{line}: {message} [{id}]"]
    command += [f"--library={Path(__file__).with_name('cppcheck.cfg')}"]
    command += ["-Idrivers", "-Iinclude", "-Isrc", "-Iconfig", *names]
    result = subprocess.run(command, cwd=tree.root, capture_output=True, text=True)
    return findings_at(result.stderr)
