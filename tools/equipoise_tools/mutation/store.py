"""What became of every mutant, on disk, so that hours of work survive an interruption."""

from __future__ import annotations

import hashlib
import json
import threading
from fnmatch import fnmatch
from pathlib import Path

from .bench import Outcome
from .generate import Mutant
from .parts import Part

OLDER_TESTS = "older tests"  # in the place of the test that killed it


def key_of(file: Path, mutated: str) -> str:
    return hashlib.sha256(f"{file}\n{mutated}".encode()).hexdigest()[:24]


def tests_of(part: Part, root: Path) -> str:
    """The state of a part's tests."""
    patterns = [pattern for stage in part.stages for pattern in stage.tests]
    state = hashlib.sha256(repr(part.stages).encode())
    for path in sorted((root / "tests").rglob("*.[ch]pp")):
        if any(fnmatch(str(path.relative_to(root / "tests")), pattern) for pattern in patterns):
            state.update(path.read_bytes())
    return state.hexdigest()[:16]


class Store:
    """A mutant that was killed stays so until its file changes; a survivor is tried again on other tests."""

    def __init__(self, path: Path):
        self.path, self.lock = path, threading.Lock()
        self.lines: dict[str, dict] = {}
        if path.is_file():
            for line in path.read_text().splitlines():
                told = json.loads(line)
                self.lines[told["key"]] = told

    def known(self, key: str, tests: str) -> Outcome | None:
        told = self.lines.get(key)
        if told is None or (told["status"] == "survived" and told["tests"] != tests):
            return None
        return Outcome(told["status"], told["by"])

    def add(self, key: str, tests: str, file: Path, mutant: Mutant, outcome: Outcome) -> None:
        told = {"key": key, "tests": tests, "status": outcome.status, "by": outcome.by}
        told |= {"file": str(file), "line": mutant.line, "kind": mutant.kind, "change": mutant.change}
        with self.lock:
            self.lines[key] = told
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a") as out:
                out.write(json.dumps(told) + "\n")

    def kept(self, key: str, tests: str) -> Outcome | None:
        """As it was, also where tests have changed since: a survivor may be killed by now."""
        told = self.lines.get(key)
        if told is None:
            return None
        older = told["status"] == "survived" and told["tests"] != tests
        return Outcome(told["status"], OLDER_TESTS if older else told["by"])
