"""The files a check looks at, and what it finds in them."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

C_SUFFIXES = (".c", ".h", ".cpp", ".hpp")


@dataclass(frozen=True, order=True)
class Finding:
    path: str
    line: int
    message: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.message}" if self.line else f"{self.path}: {self.message}"


@dataclass(frozen=True)
class Tree:
    """A source tree and the names of its files, relative to the root, in order."""

    root: Path
    files: tuple[str, ...]

    def text(self, name: str) -> str:
        return (self.root / name).read_text(encoding="utf-8", errors="replace")

    def ending(self, *suffixes: str) -> list[str]:
        """Hand-written files with one of these suffixes."""
        return [name for name in self.files if name.endswith(suffixes) and not is_generated(name)]

    def shell_scripts(self) -> list[str]:
        def is_shell(name: str) -> bool:
            if name.endswith(".sh"):
                return True
            with open(self.root / name, "rb") as file:
                first = file.readline(80)
            return first.startswith(b"#!") and first.split(b"/")[-1].split()[-1] in (b"sh", b"bash")

        return [name for name in self.files if is_shell(name)]


def is_generated(name: str) -> bool:
    return "generated" in Path(name).parts


def tree_of_git(root: Path) -> Tree:
    """What git tracks or would track: a file is checked before its first commit, build output never."""
    command = [
        "git",
        "-c",
        "safe.directory=*",
        "ls-files",
        "-z",
        "--cached",
        "--others",
        "--exclude-standard",
    ]
    listed = subprocess.run(command, cwd=root, capture_output=True, check=True).stdout.decode()
    names = sorted(set(filter(None, listed.split("\0"))))
    return Tree(root, tuple(name for name in names if (root / name).is_file()))


def tree_of_folder(root: Path) -> Tree:
    return Tree(
        root, tuple(sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()))
    )
