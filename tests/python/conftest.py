"""What the Python tests share."""

import os
import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # synthetic.py
from driven import CONFIGS, equipoise

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


def pytest_configure():
    """A shell's background job ignores Ctrl-C, and so would what the tests start and interrupt."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config, items):
    """What needs the cross build is tools/cross-test's: here it is not there, so that a skip is news."""
    if os.environ.get("EQUIPOISE_CROSS"):
        return
    cross = [item for item in items if item.get_closest_marker("cross")]
    config.hook.pytest_deselected(items=cross)
    items[:] = [item for item in items if item not in cross]


@pytest.fixture(scope="session")
def known_log(tmp_path_factory) -> Path:
    """Ten seconds of the MBBR with errors of known size."""
    from synthetic import write_log

    return write_log(tmp_path_factory.mktemp("log") / "known.lcm")


@pytest.fixture(scope="session", params=CONFIGS)
def robot(request) -> str:
    return request.param


@pytest.fixture(scope="session")
def log(root, robot, tmp_path_factory) -> Path:
    """Four seconds of each robot, driving and turning."""
    path = tmp_path_factory.mktemp("driven") / "run.lcm"
    config = ["--config", root / f"config/{CONFIGS[robot]}.toml", "--telemetry", "off", "--log", path]
    ran = equipoise(root, "sim", *config, "--drive-mps", "0.1", "--yaw-hz", "0.2", "--duration-s", "4")
    assert ran.returncode == 0, ran.stderr
    return path


@pytest.fixture(scope="session")
def browser():
    """Debian's Chromium, without a window."""
    playwright = pytest.importorskip("playwright.sync_api", reason="tools/requirements-optional.txt")
    from equipoise_tools.cockpit.measure import CHROMIUM, CHROMIUM_ARGUMENTS

    if not Path(CHROMIUM).exists():
        pytest.skip(f"no {CHROMIUM}: apt-get install chromium")
    with playwright.sync_playwright() as p:
        chromium = p.chromium.launch(executable_path=CHROMIUM, args=CHROMIUM_ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def multicast():
    """Robots that a cockpit drives talk by it."""
    from equipoise_tools.cockpit.robot import private_url
    from equipoise_tools.paths import UserError
    from equipoise_tools.view import open_source

    try:
        open_source(private_url())
    except UserError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def cockpit(root, logs, multicast):
    """With the module's folder of logs."""
    from started_cockpit import Started

    # In the full world a robot may be disarmed at any moment; these tests are about the page.
    started = Started(root, logs, "--", "--fidelity", "nominal")
    yield started
    started.end()
