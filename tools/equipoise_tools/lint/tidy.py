"""clang-tidy over our own translation units; one that passed runs again when an input changed."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .law import includes
from .tree import Finding, Tree

TOOL = "clang-tidy-14"
# The analyzer does not step into templates: in Eigen it finds nothing and triples its time.
ANALYZER = [
    f"--extra-arg={word}"
    for word in ("-Xclang", "-analyzer-config", "-Xclang", "c++-template-inlining=false")
]
_DIAGNOSTIC = re.compile(r"^(?P<path>/[^:\n]+):(?P<line>\d+):\d+: (?:warning|error): (?P<message>.*)$", re.M)


def file_by_file(build: Path) -> list[dict]:
    """The compile database, with the files of a folder that is compiled as one unit in that unit's place."""
    entries = []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        unit = Path(entry["directory"], entry["file"])
        if unit.parent.name != "Unity":
            entries.append(entry)
            continue
        command = entry.get("arguments") or shlex.split(entry["command"])
        for _, member, _ in includes(unit.read_text()):
            arguments = [member if Path(part) == unit else part for part in command]
            entries.append({"directory": entry["directory"], "file": member, "arguments": arguments})
    return entries


def own_units(tree: Tree, build: Path) -> list[tuple[str, list[str]]]:
    """(file, compile command) of the translation units of src and drivers in the compile database."""
    units = {}
    for entry in file_by_file(build):
        path = Path(entry["directory"], entry["file"]).resolve()
        if path.is_relative_to(tree.root):
            name = str(path.relative_to(tree.root))
            if name.startswith(("src/", "drivers/")):
                units[name] = entry.get("arguments") or shlex.split(entry["command"])
    return sorted(units.items())


def include_folders(command: list[str], root: Path) -> list[Path]:
    folders = [part[2:] for part in command if part.startswith("-I") and len(part) > 2]
    folders += [command[i + 1] for i, part in enumerate(command[:-1]) if part in ("-I", "-isystem")]
    return [Path(folder) for folder in folders if Path(folder).is_relative_to(root)]


def closure(name: str, folders: list[Path], tree: Tree) -> set[Path]:
    """The file and every header inside the tree (generated ones too) that it reaches."""
    reached: set[Path] = set()
    waiting = [tree.root / name]
    while waiting:
        path = waiting.pop()
        if path in reached:
            continue
        reached.add(path)
        for _, header, _ in includes(path.read_text(encoding="utf-8", errors="replace")):
            candidates = (folder / header for folder in (path.parent, *folders))
            found = next((candidate for candidate in candidates if candidate.is_file()), None)
            if found is not None:
                waiting.append(found.resolve())
    return reached


def fingerprint(name: str, command: list[str], tree: Tree, settings: bytes) -> str:
    digest = hashlib.sha256(settings)
    digest.update(shlex.join(command).encode())
    for path in sorted(closure(name, include_folders(command, tree.root), tree)):
        digest.update(str(path).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def check_unit(name: str, tree: Tree, database: Path) -> list[Finding]:
    command = [TOOL, "--quiet", *ANALYZER, "-p", str(database), str(tree.root / name)]
    result = subprocess.run(command, cwd=tree.root, capture_output=True, text=True)
    findings = []
    for match in _DIAGNOSTIC.finditer(result.stdout):
        findings.append(
            Finding(os.path.relpath(match["path"], tree.root), int(match["line"]), match["message"])
        )
    if result.returncode != 0 and not findings:
        findings.append(Finding(name, 0, f"{TOOL} failed: {(result.stderr or result.stdout).strip()[-500:]}"))
    return findings


def clang_tidy(tree: Tree, build: Path | None = None, jobs: int | None = None) -> list[Finding]:
    build = build or tree.root / "build" / "host"
    if shutil.which(TOOL) is None:
        return [Finding(TOOL, 0, "is not installed; ./tools/test installs it")]
    if not (build / "compile_commands.json").is_file():
        return [Finding(str(build), 0, "has no compile_commands.json; configure first: cmake --preset host")]
    cache = build / "tidy"
    cache.mkdir(exist_ok=True)
    database = build / "tidy-database"
    database.mkdir(exist_ok=True)
    (database / "compile_commands.json").write_text(json.dumps(file_by_file(build)))
    version = subprocess.run([TOOL, "--version"], capture_output=True, check=True).stdout
    settings = (tree.root / ".clang-tidy").read_bytes() + version + " ".join(ANALYZER).encode()
    stamps = {
        name: cache / fingerprint(name, command, tree, settings) for name, command in own_units(tree, build)
    }
    changed = [name for name, stamp in stamps.items() if not stamp.exists()]
    for old in set(cache.iterdir()) - set(stamps.values()):
        old.unlink()

    def check_and_remember(name: str) -> list[Finding]:
        findings = check_unit(name, tree, database)
        if not findings:
            stamps[name].touch()
        return findings

    with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
        found = pool.map(check_and_remember, changed)
    return sorted({finding for findings in found for finding in findings})
