"""keygen, send and run --command-key: who may command the robot; nothing listens unasked."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.live


def test_only_the_holder_of_the_key_commands_the_robot(root, tmp_path):

    environment = {**os.environ, "PYTHONPATH": f"{root}/tools:{root}/python:{root}/build/host/lcm/python"}
    command = [root / "tools/lib/multicast", sys.executable, root / "tests/python/command_run.py"]
    command += [root / "build/host/equipoise", root / "config/mbbr.toml", tmp_path]
    ended = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=120,
        env=environment,
    )
    if ended.returncode == 77:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)
    assert not result["before"]  # nobody armed it
    assert result["stranger"][0] == 1 and "same key" in result["stranger"][1]
    assert not result["after_stranger"]
    assert result["owner"][0] == 0 and "commands accepted" in result["owner"][1]
    assert result["after_owner"]
    assert result["disarm"] == 0 and not result["after_disarm"]
    assert (result["attacks"], result["accepted"]) == (1000, 0)
    assert result["refused"] > 500  # UDP loses some, some are no command at all; all: command_auth_test
    assert not result["after_attacks"]


def test_nothing_listens_by_default(root, tmp_path):
    """The system calls of a run without --command-key: no socket but its own."""
    from test_lockstep import Firmware

    firmware = Firmware(root, tmp_path)
    with firmware.connect():
        sockets = subprocess.run(
            ["ls", "-l", f"/proc/{firmware.process.pid}/fd"], capture_output=True, text=True
        ).stdout
        bound = []
        for table in ("udp", "udp6", "tcp", "tcp6"):
            for line in Path(f"/proc/{firmware.process.pid}/net/{table}").read_text().splitlines()[1:]:
                if f"socket:[{line.split()[9]}]" in sockets:
                    bound.append(line)
        assert bound == []
    firmware.process.terminate()
    firmware.end()


def test_keys_are_private(root, tmp_path):
    key = tmp_path / "key"
    binary = root / "build/host/equipoise"
    assert subprocess.run([binary, "keygen", key], capture_output=True).returncode == 0
    assert key.stat().st_mode & 0o777 == 0o600
    again = subprocess.run([binary, "keygen", key], capture_output=True, text=True)
    assert again.returncode == 2 and "File exists" in again.stderr
    key.chmod(0o644)
    ended = subprocess.run([binary, "send", "--key", key], capture_output=True, text=True)
    assert ended.returncode == 2
    assert f"chmod 600 {key}" in ended.stderr and ended.stderr.count("\n") == 1
