"""Started without standard streams, or with one that takes nothing."""

import json
import subprocess

import pytest
from driven import equipoise
from equipoise_robot.log import read_log

PATIENCE_S = 60


def shell(root, folder, line):
    command = ["bash", "-c", f"exec {root}/build/host/equipoise {line}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, cwd=folder)


@pytest.mark.parametrize("closed", ["2>&-", "1>&- 2>&-", "0<&- 1>&- 2>&-"])
def test_messages_do_not_go_into_the_log(root, tmp_path, closed):
    """The log would be the descriptor that is missing; on a board, a motor's file. Verdicts are said."""
    run = f"run --config {root}/config/mbbr.toml --backend sim --fidelity built2025 --speed 100"
    run += " --telemetry off --drive-mps 0.1 --yaw-hz 0.3 --duration-s 5 --fault encoder_dead@3+0.4"
    shell(root, tmp_path, f"{run} --log run.lcm --json run.json {closed}")
    read = read_log(tmp_path / "run.lcm")
    assert read.notes == []
    assert json.loads((tmp_path / "run.json").read_text())["armed"]
    assert equipoise(root, "replay", tmp_path / "run.lcm").returncode == 0


@pytest.mark.parametrize(
    "command",
    [
        "sim --config {config} --duration-s 1 --log off --json -",
        "config show --config {config}",
        "completion bash",
    ],
)
def test_a_result_that_a_full_disk_did_not_take_is_no_success(root, tmp_path, command):
    command = command.format(config=root / "config/edumip.toml")
    lost = shell(root, tmp_path, f"{command} > /dev/full")
    assert lost.returncode == 1 and "standard output: cannot be written" in lost.stderr
    assert shell(root, tmp_path, f"{command} > taken").returncode == 0
    read = subprocess.run(
        ["bash", "-c", f"{root}/build/host/equipoise {command} | head -c 1; echo ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        cwd=tmp_path,
    )
    assert read.stdout.endswith("0\n") and "cannot be written" not in read.stderr
