"""The last line over several levels of tests."""

import subprocess

import pytest


@pytest.fixture
def levels(tmp_path, root):
    """Runs made-up levels in a tree of their own: name -> shell script."""
    lib = tmp_path / "tools/lib"
    lib.mkdir(parents=True)
    for name in ("setup.sh", "levels.sh"):
        (lib / name).write_text((root / "tools/lib" / name).read_text())

    def run(**scripts: str):
        for name, script in scripts.items():
            (lib.parent / name).write_text(f"#!/bin/sh\n{script}\n")
            (lib.parent / name).chmod(0o755)
        command = f"source {lib}/setup.sh; source {lib}/levels.sh; run_levels {' '.join(scripts)}"
        ended = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
        return ended.returncode, ended.stdout.splitlines()[-1], ended.stderr

    return run


def test_passed_and_failed_add_up(levels):
    assert levels(one="echo 3 passed, 0 failed", two="echo x; echo 4 passed, 0 failed")[:2] == (
        0,
        "7 passed, 0 failed",
    )
    assert levels(one="echo 3 passed, 2 failed; exit 1", two="echo 4 passed, 1 failed; exit 1")[:2] == (
        1,
        "7 passed, 3 failed",
    )


def test_a_failed_level_does_not_keep_the_next_from_running(levels):
    status, last, errors = levels(one="exit 3", two="echo 4 passed, 0 failed")
    assert (status, last) == (1, "4 passed, 1 failed")
    assert "tools/one ended with status 3 and without a result" in errors


def test_a_status_without_a_failed_test_counts_as_one(levels):
    assert levels(one="echo 3 passed, 0 failed; exit 1")[:2] == (1, "3 passed, 1 failed")


def test_all_goes_with_nothing_else(root):
    command = [root / "tools/test", "--all", "--quick"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 2 and ended.stderr.startswith("error: --all")


@pytest.mark.parametrize(
    ("status", "console", "passed"),
    [
        (0, "HUNG 1\r\nHUNG 5\r\n", True),
        (0, "HUNG 1\r\nHUNG 6\r\n", False),  # the watchdog's time is over
        (0, "VM: hanging from now on\r\n", False),  # it never hung
        (124, "HUNG 1\r\nHUNG 2\r\n", False),  # nobody reset it
    ],
)
def test_a_hung_machine_must_be_reset_in_the_watchdogs_time(root, status, console, passed):
    script = f"root={root}; vm=/none; source {root}/tools/lib/vm_kernel.sh; judge_hang {status} 5"
    ended = subprocess.run(["bash", "-euc", script], input=console, capture_output=True, text=True)
    assert ("[  PASSED  ] 1 test." in ended.stdout) == passed, ended.stdout
    assert ("1 FAILED TEST" in ended.stdout) != passed
