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
from dataclasses import dataclass
from pathlib import Path

from .law import includes
from .tree import Finding, Tree

TOOL = "clang-tidy-14"
# The analyzer does not step into templates: in Eigen it finds nothing and triples its time.
ANALYZER = [
    f"--extra-arg={word}"
    for word in ("-Xclang", "-analyzer-config", "-Xclang", "c++-template-inlining=false")
]
SOURCES_INCLUDED = "bugprone-suspicious-include"  # which a folder's unit does
_DIAGNOSTIC = re.compile(r"^(?P<path>/[^:\n]+):(?P<line>\d+):\d+: (?:warning|error): (?P<message>.*)$", re.M)


@dataclass(frozen=True)
class Job:
    """A translation unit and what is looked for in it."""

    entry: dict  # of a compile database
    checks: str = ""  # added to those of .clang-tidy

    @property
    def file(self) -> Path:
        return Path(self.entry["directory"], self.entry["file"])

    @property
    def command(self) -> list[str]:
        return self.entry.get("arguments") or shlex.split(self.entry["command"])


def own(path: Path, root: Path) -> bool:
    return any(path.resolve().is_relative_to(root / folder) for folder in ("src", "drivers"))


def jobs_of(tree: Tree, build: Path) -> list[Job]:
    """Of a folder that is compiled as one unit: all but the analyzer on the unit, so that its headers are
    read once; the analyzer, which skips what is included, on every file."""
    words = re.split(r"[\s,]+", (tree.root / ".clang-tidy").read_text())
    analyzer = [word for word in words if "clang-analyzer" in word]
    file_by_file = ",".join(["-*", SOURCES_INCLUDED, *analyzer])
    jobs = []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        unit = Path(entry["directory"], entry["file"])
        if unit.parent.name != "Unity":
            jobs += [Job(entry)] if own(unit, tree.root) else []
            continue
        members = [Path(member) for _, member, _ in includes(unit.read_text())]
        if not any(own(member, tree.root) for member in members):
            continue
        jobs.append(Job(entry, f"-clang-analyzer-*,-{SOURCES_INCLUDED}"))
        command = Job(entry).command
        for member in members:
            arguments = [str(member) if Path(part) == unit else part for part in command]
            alone = {"directory": entry["directory"], "file": str(member), "arguments": arguments}
            jobs.append(Job(alone, file_by_file))
    return jobs


def include_folders(command: list[str], root: Path) -> list[Path]:
    folders = [part[2:] for part in command if part.startswith("-I") and len(part) > 2]
    folders += [command[i + 1] for i, part in enumerate(command[:-1]) if part in ("-I", "-isystem")]
    return [Path(folder) for folder in folders if Path(folder).is_relative_to(root)]


def closure(file: Path, folders: list[Path]) -> set[Path]:
    """The file and every header inside the tree (generated ones too) that it reaches."""
    reached: set[Path] = set()
    waiting = [file.resolve()]
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


def fingerprint(job: Job, root: Path, settings: bytes) -> str:
    digest = hashlib.sha256(settings)
    digest.update(shlex.join([*job.command, job.checks]).encode())
    for path in sorted(closure(job.file, include_folders(job.command, root))):
        digest.update(str(path).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def run(job: Job, root: Path, database: Path) -> list[Finding]:
    command = [TOOL, "--quiet", *ANALYZER, "-p", str(database)]
    command += [f"--checks={job.checks}"] if job.checks else []
    result = subprocess.run([*command, str(job.file)], cwd=root, capture_output=True, text=True)
    findings = []
    for match in _DIAGNOSTIC.finditer(result.stdout):
        findings.append(Finding(os.path.relpath(match["path"], root), int(match["line"]), match["message"]))
    if result.returncode != 0 and not findings:
        said = (result.stderr or result.stdout).strip()[-500:]
        findings.append(Finding(os.path.relpath(job.file, root), 0, f"{TOOL} failed: {said}"))
    return findings


def clang_tidy(tree: Tree, build: Path | None = None, jobs: int | None = None) -> list[Finding]:
    build = build or tree.root / "build" / "host"
    if shutil.which(TOOL) is None:
        return [Finding(TOOL, 0, "is not installed; ./tools/test installs it")]
    if not (build / "compile_commands.json").is_file():
        return [Finding(str(build), 0, "has no compile_commands.json; configure first: cmake --preset host")]
    cache = build / "tidy"
    cache.mkdir(exist_ok=True)
    todo = jobs_of(tree, build)
    database = build / "tidy-database"
    database.mkdir(exist_ok=True)
    (database / "compile_commands.json").write_text(json.dumps([job.entry for job in todo]))
    version = subprocess.run([TOOL, "--version"], capture_output=True, check=True).stdout
    settings = (tree.root / ".clang-tidy").read_bytes() + version + " ".join(ANALYZER).encode()
    stamps = {job.file: cache / fingerprint(job, tree.root, settings) for job in todo}
    changed = [job for job in todo if not stamps[job.file].exists()]
    for old in set(cache.iterdir()) - set(stamps.values()):
        old.unlink()

    def check_and_remember(job: Job) -> list[Finding]:
        findings = run(job, tree.root, database)
        if not findings:
            stamps[job.file].touch()
        return findings

    with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
        found = pool.map(check_and_remember, changed)
    return sorted({finding for findings in found for finding in findings})
