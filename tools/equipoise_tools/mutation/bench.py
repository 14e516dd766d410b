"""Compiles a mutant beside the host build, links it before the libraries, and runs the tests on it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

from .generate import Mutant
from .parts import Stage

# As the host build, but quickly: no debugging information, no warnings, which are not what is tested.
DROPPED = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror", "-g1")
NO_FILE = "tests/unit/safety_test.cpp"  # whose flags serve every C++ source: tests see all of them


@dataclass
class Outcome:
    status: str  # killed, survived, timeout, not_compiled, same_code
    by: str = ""


@dataclass(eq=False)  # to be a key
class Build:
    """What the host build knows: flags, link commands, who includes what. Lives as long as the program."""

    root: Path
    folder: Path
    flags: dict[str, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for entry in json.loads((self.folder / "compile_commands.json").read_text()):
            words = shlex.split(entry["command"])
            at = words.index("-o")
            self.flags[entry["file"]] = [w for w in words[1:at] if w not in DROPPED] + ["-w"]

    def flags_of(self, source: Path) -> tuple[str, list[str]]:
        c = source.suffix == ".c"
        own = self.flags.get(str(self.root / source))
        return ("cc" if c else "c++", own or self.flags[str(self.root / NO_FILE)])

    @cache  # noqa: B019
    def link(self, target: str) -> tuple[str, ...]:
        text = subprocess.run(
            ["ninja", "-t", "commands", "-s", target],
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=True,
        )
        words = shlex.split(text.stdout.splitlines()[-1])
        return tuple(words[words.index("&&") + 1 : -2])

    @cache  # noqa: B019
    def unit(self, source: Path) -> tuple[Path, ...]:
        """The other sources that the build compiles together with this one."""
        line = f'#include "{self.root / source}"\n'
        for unit in sorted(self.folder.glob("CMakeFiles/*.dir/Unity/*.cxx")):
            text = unit.read_text()
            if line in text:
                found = re.findall(r'^#include "(.*)"$', text, re.M)
                return tuple(p for p in (Path(f).relative_to(self.root) for f in found) if p != source)
        return ()

    @cache  # noqa: B019
    def includes(self, test_object: str) -> frozenset[str]:
        text = subprocess.run(
            ["ninja", "-t", "deps", test_object], cwd=self.folder, capture_output=True, text=True, check=True
        )
        return frozenset(str((self.folder / line.strip()).resolve()) for line in text.stdout.splitlines()[1:])


class Timeout(Exception):
    pass


def run(command: list[str], cwd: Path, limit_s: float, **options) -> int:
    """Its exit status; ends all that it has started when it takes too long."""
    with subprocess.Popen(
        command,
        cwd=cwd,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        **options,
    ) as process:
        try:
            return process.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise Timeout from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


class Worker:
    """A folder in which one mutant at a time is built and run."""

    COMPILE_LIMIT_S = 3600.0  # every compilation ends; a machine may have other work

    def __init__(self, build: Build, folder: Path):
        self.build, self.folder = build, folder
        self.overlay = folder / "source"
        folder.mkdir(parents=True, exist_ok=True)
        self.program_tests: dict[str, Path] = {}
        self.companions: dict[Path, Path] = {}

    def compile(self, source: Path, text: str | None, defines: tuple[str, ...] = ()) -> Path | None:
        """The object of a source of the project, with the mutated file before the others."""
        compiler, flags = self.build.flags_of(source)
        place = self.build.root / source
        if text is not None:
            place = self.overlay / source
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text)
        made = self.folder / "objects" / (str(source).replace("/", "_") + ".o")
        made.parent.mkdir(exist_ok=True)
        before = [f"-I{self.overlay / name}" for name in ("include", "src", "drivers", ".")]
        before.append(f"-iquote{(self.build.root / source).parent}")
        kept = [flag for flag in flags if not any(flag.startswith(d.split("=")[0]) for d in defines)]
        command = [compiler, *before, *kept, *defines, "-g0", "-c", str(place), "-o", str(made)]
        status = run(command, self.build.folder, self.COMPILE_LIMIT_S)
        return made if status == 0 else None

    def tests_of(self, stage: Stage) -> tuple[list[str], list[str]]:
        """Objects of the binary that are linked, and all."""
        prefix = str(Path(stage.binary).name) + ".dir/"
        own = [w for w in self.build.link(stage.binary) if w.endswith(".o") and prefix in w]
        part = Path(stage.binary).parent.relative_to("tests")

        def name(made: str) -> str:
            return str(part / made.split(prefix, 1)[1].removesuffix(".o"))

        return [o for o in own if any(fnmatch(name(o), pattern) for pattern in stage.tests)], own

    def source_of(self, stage: Stage, made: str) -> Path:
        prefix = str(Path(stage.binary).name) + ".dir/"
        return Path(stage.binary).parent / made.split(prefix, 1)[1].removesuffix(".o")

    def join(self, target: str, objects: list[str], own: list[str], made: Path) -> bool:
        words = [w for w in self.build.link(target) if w not in own and not w.startswith("-g")]
        at = words.index("-o")
        words[at + 1] = str(made)
        # What comes first is taken; of a library's object that holds the unchanged one, too, the rest of it.
        extra = ["-Wl,--allow-multiple-definition", "-fuse-ld=gold"]
        return run(words[:at] + extra + objects + words[at:], self.build.folder, self.COMPILE_LIMIT_S) == 0

    def prepare(self, stage: Stage, file: Path, text: str, changed: Path | None) -> Path | None:
        """The binary of a stage with this text for the file; None: it is not to be built."""
        linked, own = self.tests_of(stage)
        first = [changed, *self.beside(file)] if changed else []
        if changed is None:  # a header: all that sees it
            place = self.overlay / file
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text)
            for source in stage.sources:
                first.append(self.compile(Path(source), None))
            for i, made in enumerate(linked):
                if str(self.build.root / file) in self.build.includes(made):
                    linked[i] = self.compile(self.source_of(stage, made), None)
        objects = first + linked
        if any(made is None for made in objects):
            return None
        program = self.folder / "equipoise"
        if stage.program:
            main = [w for w in self.build.link("equipoise") if w.endswith(".o")]
            if not self.join("equipoise", [*map(str, first), *main], main, program):
                return None
            objects = [*first, *(self.bound(stage, made, program) for made in linked)]
        binary = self.folder / Path(stage.binary).name
        return binary if self.join(stage.binary, list(map(str, objects)), own, binary) else None

    def beside(self, file: Path) -> list[Path]:
        """What the build compiles together with a file, here apart: there, its functions may be inlined."""
        for source in self.build.unit(file):
            if source not in self.companions:
                made = self.compile(source, None)
                if made is None:
                    raise RuntimeError(f"{source} does not compile")
                self.companions[source] = made.rename(made.with_suffix(".beside.o"))
        return [self.companions[source] for source in self.build.unit(file)]

    def bound(self, stage: Stage, made: str, program: Path) -> str:
        """A test that starts this worker's program."""
        if made not in self.program_tests:
            source = self.source_of(stage, made)
            bound = self.compile(source, None, (f'-DEQUIPOISE_BINARY="{program}"',))
            if bound is None:
                raise RuntimeError(f"{source} does not compile")
            self.program_tests[made] = bound.rename(bound.with_suffix(".bound.o"))
        return str(self.program_tests[made])

    def test(self, stage: Stage, binary: Path, limit_s: float) -> bool:
        """Whether all its tests pass."""
        scratch = self.folder / "tmp"
        scratch.mkdir(exist_ok=True)
        environment = {**os.environ, "TMPDIR": str(scratch), "TEST_TMPDIR": str(scratch)}
        command = [
            str(self.build.root / "tools/lib/multicast"),
            str(binary),
            f"--gtest_filter={stage.filter}",
        ]
        command += ["--gtest_brief=1"] + ([] if stage.twice else ["--gtest_fail_fast"])
        return run(command, self.build.root, limit_s, env=environment) == 0

    def clean(self) -> None:
        if self.overlay.exists():
            for path in self.overlay.rglob("*"):
                if path.is_file():
                    path.unlink()

    def judge(
        self,
        stages: list[Stage],
        file: Path,
        text: str,
        mutant: Mutant,
        limit: Callable[[Worker, Stage], float],
        same: str,
    ) -> Outcome:
        self.clean()
        changed = None
        mutated = mutant.of(text)
        if file.suffix in (".c", ".cpp"):
            changed = self.compile(file, mutated)
            if changed is None:
                return Outcome("not_compiled")
            if code_of(changed) == same:
                return Outcome("same_code")
        for stage in stages:
            limit_s = limit(self, stage)
            binary = self.prepare(stage, file, mutated, changed)
            if binary is None:
                return Outcome("not_compiled")
            try:
                if self.test(stage, binary, limit_s):
                    continue
                if stage.twice and self.test(stage, binary, limit_s):
                    continue
            except Timeout:
                return Outcome("timeout", stage.binary)
            return Outcome("killed", stage.binary)
        return Outcome("survived")

    def unchanged_code(self, file: Path, text: str) -> str:
        """What a mutant must differ from; of a header there is none."""
        self.clean()
        if file.suffix not in (".c", ".cpp"):
            return ""
        made = self.compile(file, text)
        if made is None:
            raise RuntimeError(f"{file} does not compile without a change")
        return code_of(made)

    def limit(self, stage: Stage) -> float:
        """The time that the tests of a stage may take; as the build has them they pass."""
        linked, own = self.tests_of(stage)
        binary = self.folder / Path(stage.binary).name
        if not self.join(stage.binary, linked, own, binary):
            raise RuntimeError(f"{stage.binary}: does not build without a change")
        for _ in range(3 if stage.twice else 1):
            began = time.monotonic()
            if self.test(stage, binary, 600.0):
                return 10.0 + 10.0 * (time.monotonic() - began)
        raise RuntimeError(f"{stage.binary}: fails without a change")


def code_of(made: Path) -> str:
    return hashlib.sha256(made.read_bytes()).hexdigest()
