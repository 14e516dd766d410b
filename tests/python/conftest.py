"""What the Python tests share."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # synthetic.py
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


def pytest_collection_modifyitems(items):
    if os.environ.get("EQUIPOISE_CROSS"):
        return
    for item in items:
        if item.get_closest_marker("cross"):
            item.add_marker(pytest.mark.skip(reason="needs the cross build; tools/cross-test runs it"))


@pytest.fixture(scope="session")
def known_log(tmp_path_factory) -> Path:
    """Ten seconds of the MBBR with errors of known size."""
    from synthetic import write_log

    return write_log(tmp_path_factory.mktemp("log") / "known.lcm")
