"""A misspelt key is named at the start wherever it stands, also in a table that this start does not need."""

import re
import subprocess

import pytest

HEAD = re.compile(r"^\[+([^\]]+)\]+[^\n]*\n", re.M)
TYPO = "tpyo"


def not_refused(text: str, file, command) -> list[str]:
    """Tables in which a misspelt key is not named; the first of several of one name stands for all."""
    ends = {"": 0} | {m[1]: m.end() for m in reversed(list(HEAD.finditer(text)))}
    found = []
    for table, end in ends.items():
        file.write_text(f"{text[:end]}{TYPO} = 1\n{text[end:]}")
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=60)
        if done.returncode != 2 or TYPO not in done.stderr or done.stderr.count("\n") != 1:
            found.append(f"[{table}]: {done.returncode}, {done.stderr}")
    assert len(ends) > 2
    return found


def run(root, *arguments):
    return [
        root / "build/host/equipoise",
        "run",
        "--backend",
        "sim",
        "--log",
        "off",
        "--duration-s",
        "1",
        *arguments,
    ]


@pytest.mark.parametrize("robot", ["mbbr", "edumip", "kugle"])
def test_in_a_configuration(root, tmp_path, robot):
    text = (root / f"config/{robot}.toml").read_text()
    text = re.sub(r'^base = "', f'base = "{root}/config/', text, flags=re.M)
    file = tmp_path / "robot.toml"
    assert not_refused(text, file, run(root, "--config", file)) == []


@pytest.mark.parametrize("remote", ["gamepad", "keyboard", "hc06"])
def test_in_a_remote(root, tmp_path, remote):
    text = (root / f"config/remotes/{remote}.toml").read_text()
    file = tmp_path / "remote.toml"
    assert not_refused(text, file, run(root, "--config", root / "config/edumip.toml", "--remote", file)) == []


def test_in_a_board_file(root, tmp_path):
    for board in sorted((root / "config/boards").glob("*_edumip.toml")):
        file = tmp_path / "board.toml"
        command = [
            root / "build/host/equipoise",
            "run",
            "--config",
            root / "config/edumip.toml",
            "--board",
            file,
        ]
        assert (
            not_refused(board.read_text(), file, [*command, "--log", "off", "--duration-s", "1"]) == []
        ), board
