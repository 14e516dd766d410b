"""Formatters and per-language linters of others, run over our files."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

from .tree import C_SUFFIXES, Finding, Tree

_LOCATED = re.compile(r"^(?P<path>[^:\n]+):(?P<line>\d+):(?:\d+:)? (?P<message>.*)$", re.M)


def _run(tree: Tree, command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=tree.root, capture_output=True, text=True)


def findings_at(output: str) -> list[Finding]:
    return [Finding(m["path"], int(m["line"]), m["message"]) for m in _LOCATED.finditer(output)]


def missing(tool: str) -> list[Finding]:
    return [Finding(tool, 0, "is not installed; ./tools/test installs it")]


def _findings(result: subprocess.CompletedProcess[str], tool: str, output: str) -> list[Finding]:
    """A tool that fails without naming a place is itself the finding."""
    if result.returncode == 0:
        return []
    return findings_at(output) or [
        Finding(tool, 0, (output or result.stderr).strip() or "failed without a word")
    ]


def clang_format(tree: Tree, fix: bool = False) -> list[Finding]:
    files = tree.ending(*C_SUFFIXES)
    tool = "clang-format-14"
    if not files:
        return []
    if shutil.which(tool) is None:
        return missing(tool)
    result = _run(tree, [tool, *(["-i"] if fix else ["--dry-run", "-Werror"]), *files])
    if result.returncode == 0:
        return []
    first: dict[str, int] = {}  # one finding per file: its first difference
    for finding in findings_at(result.stderr):
        first.setdefault(finding.path, finding.line)
    findings = [Finding(path, line, "is not as clang-format formats it") for path, line in first.items()]
    return findings or [Finding(tool, 0, result.stderr.strip())]


def black(tree: Tree, fix: bool = False) -> list[Finding]:
    files = tree.ending(".py")
    if not files:
        return []
    result = _run(tree, [sys.executable, "-m", "black", "--quiet", *([] if fix else ["--check"]), *files])
    if result.returncode == 0:
        return []
    verbose = _run(tree, [sys.executable, "-m", "black", "--check", *files]).stderr
    named = re.findall(r"^(?:would reformat|error: cannot format) ([^\n]+)$", verbose, re.M)
    findings = [Finding(name, 0, "is not as black formats it") for name in named]
    return findings or [Finding("black", 0, verbose.strip())]


def ruff(tree: Tree, fix: bool = False) -> list[Finding]:
    files = tree.ending(".py")
    if not files:
        return []
    arguments = ["--no-cache", "--output-format=concise", "--quiet", *(["--fix"] if fix else [])]
    result = _run(tree, [sys.executable, "-m", "ruff", "check", *arguments, *files])
    return _findings(result, "ruff", result.stdout or result.stderr)


def shellcheck(tree: Tree) -> list[Finding]:
    files = tree.shell_scripts()
    if not files:
        return []
    if shutil.which("shellcheck") is None:
        return missing("shellcheck")
    result = _run(tree, ["shellcheck", "--external-sources", "--format=gcc", *files])
    return _findings(result, "shellcheck", result.stdout or result.stderr)
