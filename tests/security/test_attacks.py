"""What attacks.py plays against the real program has no wrong outcome, on any wire."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.live

EXPECTATIONS = {
    "stale_arm": 5,
    "replayed_arm": 5,
    "spoofed_announcement": 5,
    "sequence_exhaustion": 5,
    "two_robots": 4,
    "two_senders": 5,
    "garbage_flood": 5,
}
played = {}


def outcome(root, folder, wire):
    if wire not in played:
        command = [root / "tools/lib/multicast", sys.executable, root / "tests/security/attacks.py"]
        command += [root / "build/host/equipoise", root / "config/mbbr.toml", folder, wire]
        environment = {**os.environ, "PYTHONPATH": f"{root}/tools:{root}/python:{root}/build/host/lcm/python"}
        played[wire] = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)
    ended = played[wire]
    if ended.returncode == 77:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


@pytest.mark.parametrize("wire", ["lcm", "serial"])
@pytest.mark.parametrize("attack", EXPECTATIONS)
def test_an_attack_has_no_wrong_outcome(root, tmp_path, wire, attack):
    expectations = outcome(root, tmp_path, wire)[attack]
    assert len(expectations) == EXPECTATIONS[attack]
    assert all(expectations.values()), expectations
