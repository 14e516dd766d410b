"""clang-tidy over our own translation units; one that passed runs again when an input changed."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from .law import includes
from .tree import Finding, Tree

TOOL = Path(sys.executable).with_name("clang-tidy")  # of tools/requirements.txt
# The analyzer does not step into templates: in Eigen it finds nothing and triples its time. A dozen functions
# that build strings have more paths than any budget: theirs is that of the analyzer's shallow mode.
ANALYZER = ["--extra-arg=-Qunused-arguments"] + [  # the compiler's own, of GCC
    f"--extra-arg={word}"
    for option in ("c++-template-inlining=false", "max-nodes=75000")
    for word in ("-Xclang", "-analyzer-config", "-Xclang", option)
]
_DIAGNOSTIC = re.compile(r"^(?P<path>/[^:\n]+):(?P<line>\d+):\d+: (?:warning|error): (?P<message>.*)$", re.M)


@dataclass(frozen=True)
class Job:
    """A translation unit: a file of ours, or a folder's sources one after the other in a file of its own."""

    entry: dict  # of a compile database
    members: tuple[Path, ...] = ()

    @property
    def file(self) -> Path:
        return Path(self.entry["directory"], self.entry["file"])

    @property
    def command(self) -> list[str]:
        return self.entry.get("arguments") or shlex.split(self.entry["command"])

    def place(self, path: str, line: int) -> tuple[str, int]:
        """Where a line of the unit is in the sources."""
        if self.members and Path(path) == self.file:
            for member in self.members:
                lines = len(_text(member).splitlines())
                if line <= lines:
                    return str(member), line
                line -= lines
        return path, line


def _text(member: Path) -> str:
    text = member.read_text(encoding="utf-8", errors="replace")
    return text if text.endswith("\n") else text + "\n"


def own(path: Path, root: Path) -> bool:
    return any(path.resolve().is_relative_to(root / folder) for folder in ("src", "drivers"))


def jobs_of(tree: Tree, build: Path, folder: Path) -> list[Job]:
    """A folder that is compiled as one unit is looked at as one, so that its headers are read once: in a
    file that holds its sources, for the analyzer skips what is included."""
    jobs = []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        unit = Path(entry["directory"], entry["file"])
        if unit.parent.name != "Unity":
            jobs += [Job(entry)] if own(unit, tree.root) else []
            continue
        members = tuple(Path(member) for _, member, _ in includes(unit.read_text()))
        if not any(own(member, tree.root) for member in members):
            continue
        together = folder / f"{unit.parent.parent.stem}_{unit.stem}.cpp"
        together.write_text("".join(map(_text, members)))
        arguments = [str(together) if Path(part) == unit else part for part in Job(entry).command]
        for beside in sorted({str(member.parent) for member in members}):
            arguments[1:1] = ["-iquote", beside]
        entry = {"directory": entry["directory"], "file": str(together), "arguments": arguments}
        jobs.append(Job(entry, members))
    return jobs


def include_folders(command: list[str], root: Path) -> list[Path]:
    folders = [part[2:] for part in command if part.startswith("-I") and len(part) > 2]
    options = ("-I", "-iquote", "-isystem")
    folders += [command[i + 1] for i, part in enumerate(command[:-1]) if part in options]
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
    digest.update(shlex.join(job.command).encode())
    for path in sorted(closure(job.file, include_folders(job.command, root))):
        digest.update(str(path).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def run(job: Job, root: Path, database: Path) -> list[Finding]:
    command = [TOOL, "--quiet", *ANALYZER, "-p", str(database)]
    result = subprocess.run([*command, str(job.file)], cwd=root, capture_output=True, text=True)
    findings = []
    for match in _DIAGNOSTIC.finditer(result.stdout):
        path, line = job.place(match["path"], int(match["line"]))
        findings.append(Finding(os.path.relpath(path, root), line, match["message"]))
    if result.returncode != 0 and not findings:
        said = (result.stderr or result.stdout).strip()[-500:]
        findings.append(Finding(os.path.relpath(job.file, root), 0, f"{TOOL.name} failed: {said}"))
    return findings


def clang_tidy(tree: Tree, build: Path | None = None, jobs: int | None = None) -> list[Finding]:
    build = build or tree.root / "build" / "host"
    if not TOOL.is_file():
        return [Finding(TOOL.name, 0, "is not installed; ./tools/test installs it")]
    if not (build / "compile_commands.json").is_file():
        return [Finding(str(build), 0, "has no compile_commands.json; configure first: cmake --preset host")]
    cache = build / "tidy"
    cache.mkdir(exist_ok=True)
    database = build / "tidy-database"
    database.mkdir(exist_ok=True)
    todo = jobs_of(tree, build, database)
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
