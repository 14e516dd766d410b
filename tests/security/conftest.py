"""What the attacks share with the other Python tests."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests/python")]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT
