"""Code for one instruction set must not be what the linker takes for another's (src/robots/lanes)."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path

import pytest
from equipoise_tools.paths import repository_root

OBJECTS = sorted((repository_root() / "build/host/CMakeFiles").glob("**/src/robots/lanes/roll_*.o"))


def defined(file: Path) -> list[str]:
    said = subprocess.run(["nm", "-C", str(file)], capture_output=True, text=True, check=True).stdout
    words = [line.split(None, 2) for line in said.splitlines()]
    return [w[2] for w in words if len(w) == 3 and w[1] in "TtWwVvu"]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="other machines have the baseline alone")
def test_every_symbol_of_an_instruction_set_carries_its_name() -> None:
    assert {o.name for o in OBJECTS} == {f"roll_{isa}.cpp.o" for isa in ("avx2", "avx512", "baseline")}
    for file in OBJECTS:
        isa = file.name.split(".")[0].removeprefix("roll_")
        symbols = defined(file)
        assert len(symbols) > 10
        strangers = [s for s in symbols if f"{isa}::" not in s]
        assert strangers == [], f"{file.name}: {strangers[:3]}"
