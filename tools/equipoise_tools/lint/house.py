"""House rules a machine can check: headers explain themselves, files stay short, the tree small."""

from __future__ import annotations

import re

from .tree import Finding, Tree, is_generated

# Paths of one developer's machine, package hosts, and the source text, which is not ours to ship.
FORBIDDEN = (
    (
        re.compile(r"/(?:wor[k]|far[m]|roo[t])/|(?<![\w.)}>*])/(?:wor[k]|far[m]|roo[t])\b"),
        "a path of one machine",
    ),
    (re.compile(r"(?:\bdeb |index-ur[l]|registr[y]).*https?://", re.I), "a package host"),
    (re.compile(r"share[d]/thesis|thesis\.tx[t]"), "a reference to the dissertation's file"),
    (re.compile(r"#\s*if\s+[0]\b|\bTOD[O]\b|\bFIXM[E]\b|\bXX[X]\b"), "residue: do it or drop it"),
)
LONGEST_OPENING_COMMENT = 8
LONGEST_FILE = 400
PLAIN = ("src/app/", "src/runtime/", "src/config/")  # above the tick: functions and interfaces
MOST_TEMPLATES = 8  # there: what wraps a robot's own types, and what visits fields of any type
LARGEST_TREE = 8 * 2**20  # bytes: who clones it fetches its history, too
_BINARY = (".png", ".gif", ".svg", ".lcm", ".log", ".bin", ".gz", ".ico", ".csv", ".parquet")


def forbidden_words(tree: Tree) -> list[Finding]:
    findings = set()
    for name in tree.files:
        if name.endswith(_BINARY):
            continue
        text = tree.text(name)
        for pattern, what in FORBIDDEN:
            for match in pattern.finditer(text):
                line = text.count("\n", 0, match.start() + 1) + 1
                findings.add(Finding(name, line, f"holds {what}: {match[0].strip()}"))
    return sorted(findings)


def opening_comment(text: str) -> int:
    """How many lines the comment at the top of the file takes; 0 when there is none."""
    lines = text.splitlines()
    if lines and lines[0].startswith("//"):
        return next((i for i, line in enumerate(lines) if not line.startswith("//")), len(lines))
    if lines and lines[0].startswith("/*"):
        return next((i + 1 for i, line in enumerate(lines) if "*/" in line), len(lines))
    return 0


def headers_open_with_a_comment(tree: Tree) -> list[Finding]:
    findings = []
    for name in tree.ending(".h", ".hpp"):
        if not name.startswith(("include/", "drivers/", "src/")):
            continue
        lines = opening_comment(tree.text(name))
        if lines == 0:
            findings.append(Finding(name, 1, "does not open with a comment: what, in -> out, RT-safe or not"))
        elif lines > LONGEST_OPENING_COMMENT:
            findings.append(
                Finding(name, 1, f"opens with {lines} lines, more than {LONGEST_OPENING_COMMENT}")
            )
    return findings


def short_files(tree: Tree) -> list[Finding]:
    findings = []
    for name in tree.files:
        if name.endswith((".c", ".h", ".cpp", ".hpp", ".py")) and not is_generated(name):
            lines = tree.text(name).count("\n")
            if lines > LONGEST_FILE:
                findings.append(Finding(name, 0, f"has {lines} lines, more than {LONGEST_FILE}: split it"))
    return findings


def plain_above_the_tick(tree: Tree) -> list[Finding]:
    counts = {name: tree.text(name).count("template <") for name in tree.files if name.startswith(PLAIN)}
    total = sum(counts.values())
    if total <= MOST_TEMPLATES:
        return []
    most = max(counts, key=counts.__getitem__)
    return [
        Finding(most, 0, f"has {counts[most]} of {total} templates above the tick, limit {MOST_TEMPLATES}")
    ]


def small_tree(tree: Tree) -> list[Finding]:
    """Generated pages and pictures grow without anybody noticing; a picture is kept once."""
    findings = [
        Finding(name, 0, "is kept as a .png, too: one format for a picture")
        for name in tree.files
        if name.endswith(".svg") and name.removesuffix("svg") + "png" in tree.files
    ]
    sizes = {name: (tree.root / name).lstat().st_size for name in tree.files}
    total = sum(sizes.values())
    if total > LARGEST_TREE:
        largest = max(sizes, key=sizes.__getitem__)
        message = f"is the largest of {total / 2**20:.2f} MB; {LARGEST_TREE / 2**20:g} MB is the limit"
        findings.append(Finding(largest, 0, message))
    return findings


def house(tree: Tree) -> list[Finding]:
    checks = (
        forbidden_words, headers_open_with_a_comment, short_files, plain_above_the_tick, small_tree,
    )  # fmt: skip
    return [finding for check in checks for finding in check(tree)]
