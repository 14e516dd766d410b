"""Code of the filters for one instruction set must not be what the linker takes for another's."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path

import pytest
from equipoise_tools.paths import repository_root

BUILD = repository_root() / "build/host/CMakeFiles"


def defined(file: Path, kinds: str = "TtWwVvu") -> list[str]:
    said = subprocess.run(["nm", "-C", str(file)], capture_output=True, text=True, check=True).stdout
    words = [line.split(None, 2) for line in said.splitlines()]
    return [w[2] for w in words if len(w) == 3 and w[1] in kinds]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="other machines have one body of each")
@pytest.mark.parametrize("robot", ["mbbr", "mip"])
def test_what_filters_have_for_avx512_stays_in_their_file(robot: str) -> None:
    (file,) = BUILD.glob(f"**/config/generated/{robot}_filter.cpp.o")
    clones = [s for s in defined(file, "t") if s.endswith("[clone .arch_x86_64_v4]")]
    assert len(clones) == 8  # four steps, in double and in single precision
    strangers = [s for s in defined(file, "TWwVvu") if "resolver" not in s and "::prepare(" not in s]
    assert strangers == []
