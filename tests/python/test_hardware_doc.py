"""docs/hardware.md: every command exists, with every option it is given, and the practice ones work."""

import re
import shlex
import shutil
import subprocess
from functools import cache

import pytest

# Commands of a Debian system that the page may use; what they do is Debian's.
SYSTEM = {
    "apt-cache",
    "adduser",
    "reboot",
    "timedatectl",
    "systemctl",
    "journalctl",
    "ip",
    "tee",
    "sed",
    "echo",
    "lsblk",
    "dd",
    "ssh",
}


def commands(root) -> list[tuple[str, list[str]]]:
    """(where, words) of each command, pipes taken apart, sudo left out."""
    found = []
    for where, block in re.findall(
        r"^```sh (\w+)\n(.*?)^```", (root / "docs/hardware.md").read_text(), re.M | re.S
    ):
        for line in block.strip().splitlines():
            for part in re.split(r" \| ", line):
                words = shlex.split(part)
                found.append((where, words[1:] if words[0] == "sudo" else words))
    return found


@cache
def help_of(*command: str) -> str:
    ended = subprocess.run([*command, "--help"], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, f"{command} --help: {ended.stderr}"
    return ended.stdout


def test_the_page_has_commands_for_both_machines(root):
    found = commands(root)
    assert len(found) > 25 and {where for where, _ in found} == {"laptop", "robot"}


def test_every_block_says_where_it_runs(root):
    fences = re.findall(r"^```(.+)$", (root / "docs/hardware.md").read_text(), re.M)
    assert set(fences) == {"sh laptop", "sh robot"}


def test_every_command_exists_with_its_options(root):
    for where, words in commands(root):
        name = words[0]
        if name == "equipoise" or name == "build/host/equipoise":
            assert (where == "robot") == (name == "equipoise"), words
            text = help_of(str(root / "build/host/equipoise"), words[1])
        elif name.startswith("/usr/lib/equipoise/"):
            assert f"put 755 \"$packaging/{name.rsplit('/', 1)[1]}\"" in (root / "tools/package").read_text()
            continue
        elif name.startswith("tools/"):
            assert where == "laptop", words
            text = help_of(str(root / name))
        else:
            assert name in SYSTEM, words
            continue
        for word in words[1:]:
            if word.startswith("--"):
                option = word.split("=")[0]
                assert re.search(rf"(?<![\w-]){option}(?![\w-])", text), f"{' '.join(words)}: {option}"


def test_calibrations_of_the_page_are_those_of_the_program(root):
    named = {words[2] for _, words in commands(root) if words[1:2] == ["calibrate"]}
    text = help_of(str(root / "build/host/equipoise"), "calibrate")
    assert named == {"gyro", "accel", "mount", "motors", "encoders"}
    assert all(f"{what}:" in text for what in named)


def test_files_of_the_page_are_in_the_repository_or_the_package(root):
    text = (root / "docs/hardware.md").read_text()
    for page in ("hardware", "wiring", "bringup-checklist"):
        for link in re.findall(r"\]\(([^)#:]+)\)", (root / f"docs/{page}.md").read_text()):
            assert (root / "docs" / link).exists(), link
    script = (root / "tools/package").read_text()
    assert "lib/firmware/equipoise-$overlay-${cells}cell.dtbo" in script
    for overlay in set(re.findall(r"/lib/firmware/equipoise-(\w+)\.dtbo", text)):
        assert (root / f"packaging/equipoise-{overlay}.dts").exists()
    for config in set(re.findall(r"/etc/equipoise/([\w/]+\.toml)", text)):
        assert (root / "config" / config).exists(), config


def practice(root) -> list[list[str]]:
    return [words for _, words in commands(root) if "stand" in words]


@pytest.mark.parametrize("number", [0, 1])
def test_the_practice_commands_work_as_printed(root, tmp_path, number):
    shutil.copytree(root / "config", tmp_path / "config")
    (tmp_path / "build").mkdir()
    words = practice(root)[number]
    ended = subprocess.run(
        [root / words[0], *words[1:]], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert ended.returncode == 0, ended.stderr
    assert list((tmp_path / "build").iterdir())
