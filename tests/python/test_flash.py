"""tools/flash against a robot made of shell scripts: install, failure with the old package back, rollback."""

import os
import subprocess
from pathlib import Path

import pytest

TOOLS = {
    # ssh [-o OPTION]... HOST COMMAND...: runs it "there", in the robot's home and with the robot's commands.
    "ssh": 'while [ "$1" = -o ]; do shift 2; done; shift; cd "$ROBOT"; export HOME="$ROBOT"\n'
    'PATH="$ROBOT/bin:$PATH"; export PATH; exec sh -c "$*"',
}
ROBOT = {
    "dpkg": 'case "$*" in *--configure*) rm -f "$ROBOT/interrupted" ;;\n'
    "*) echo ${ARCHITECTURE:-armhf} ;; esac",
    "id": "echo 0",
    "env": "shift; exec $*",
    "apt-get": 'for last; do :; done; [ ! -e "$ROBOT/interrupted" ] || exit 100\n'
    'grep -q broken "$last" && exit 100; cp "$last" "$ROBOT/installed"',
    "equipoise": 'grep -q crashes "$ROBOT/installed" && exit 1; echo 0.1.0',
    "systemctl": 'echo "$*" >>"$ROBOT/systemctl.log"; [ "$1" != is-active ] || [ -e "$ROBOT/running" ]',
}


@pytest.fixture
def robot(tmp_path) -> Path:
    for folder, scripts in ((tmp_path / "tools", TOOLS), (tmp_path / "robot/bin", ROBOT)):
        folder.mkdir(parents=True)
        for name, body in scripts.items():
            (folder / name).write_text(f"#!/bin/sh\n{body}\n")
            (folder / name).chmod(0o755)
    return tmp_path / "robot"


def package(folder: Path, content: str, architecture="armhf") -> Path:
    """A real, tiny package whose description says how it will behave."""
    tree = folder / content / "DEBIAN"
    tree.mkdir(parents=True, exist_ok=True)
    (tree / "control").write_text(
        f"Package: equipoise\nVersion: 1\nArchitecture: {architecture}\n"
        "Maintainer: A <a@b.c>\nDescription: x\n"
    )
    file = folder / f"{content}.deb"
    subprocess.run(["dpkg-deb", "-Znone", "-b", tree.parent, file], check=True, capture_output=True)
    file.write_bytes(file.read_bytes() + f"\n{content}\n".encode())
    return file


def flash(root, robot, *arguments, **environment):
    variables = {**os.environ, "PATH": f"{robot.parent}/tools:{os.environ['PATH']}", "ROBOT": str(robot)}
    command = [root / "tools/flash", *arguments]
    return subprocess.run(
        command, env={**variables, **environment}, capture_output=True, text=True, timeout=60
    )


def installed(robot: Path) -> str:
    return (robot / "installed").read_bytes().decode(errors="replace").rstrip().rsplit("\n", 1)[-1]


def test_packages_are_installed_and_rolled_back(root, robot, tmp_path):
    for name in ("first", "second"):
        ended = flash(root, robot, "--package", package(tmp_path, name), "bone")
        assert ended.returncode == 0, ended.stderr
        assert installed(robot) == name
    for name in ("first", "second"):  # back, and back again
        assert flash(root, robot, "--rollback", "bone").returncode == 0
        assert installed(robot) == name


@pytest.mark.parametrize("fault", ["broken", "crashes"])
def test_a_package_that_does_not_work_is_replaced_by_the_one_before(root, robot, tmp_path, fault):
    assert flash(root, robot, "--package", package(tmp_path, "good"), "bone").returncode == 0
    ended = flash(root, robot, "--package", package(tmp_path, fault), "bone")
    assert ended.returncode == 1 and "the old one is back" in ended.stderr
    assert installed(robot) == "good"
    assert flash(root, robot, "--rollback", "bone").returncode == 1  # a bad package is never "previous"
    assert installed(robot) == "good"


def test_an_installation_that_was_interrupted_is_finished_first(root, robot, tmp_path):
    (robot / "interrupted").touch()
    ended = flash(root, robot, "--package", package(tmp_path, "first"), "bone")
    assert ended.returncode == 0, ended.stderr
    assert installed(robot) == "first"


def test_a_running_robot_is_left_alone(root, robot, tmp_path):
    (robot / "running").touch()
    ended = flash(root, robot, "--package", package(tmp_path, "first"), "bone")
    assert ended.returncode == 1 and "is running" in ended.stderr
    assert not (robot / "installed").exists()
    assert flash(root, robot, "--force", "--package", package(tmp_path, "first"), "bone").returncode == 0
    log = (robot / "systemctl.log").read_text()
    assert log.index("stop equipoise") < log.index("start equipoise")


def test_a_package_for_another_machine_is_not_sent(root, robot, tmp_path):
    file = package(tmp_path, "first", architecture="amd64")
    ended = flash(root, robot, "--package", file, "bone")
    assert ended.returncode == 1 and "is for amd64, bone is armhf" in ended.stderr
    assert not (robot / ".local").exists()


def test_a_dry_run_shows_the_commands_and_runs_none(root, robot, tmp_path):
    ended = flash(root, robot, "--dry-run", "--package", package(tmp_path, "first"), "bone")
    assert ended.returncode == 0
    assert ended.stdout.splitlines() == [
        "ssh bone dpkg --print-architecture",
        "ssh bone mkdir -p .local/share/equipoise && cat >.local/share/equipoise/new.deb",
        "ssh bone FORCE=no sh -s install",
    ]
    assert not (robot / ".local").exists()


def test_bad_usage_is_one_clear_line(root, robot, tmp_path):
    (tmp_path / "text.deb").write_text("no package")
    for arguments in ([], ["a", "b"], ["--oops", "a"], ["--rollback", "--package", "x", "a"], ["--package"]):
        ended = flash(root, robot, *arguments)
        assert ended.returncode == 2 and ended.stderr.count("\n") == 1, arguments
    assert flash(root, robot, "--package", tmp_path / "text.deb", "bone").returncode == 2


def test_what_is_missing_is_named_with_its_remedy(root, robot, tmp_path):
    tools = tmp_path / "clone/tools"  # in which nothing was packaged
    tools.mkdir(parents=True)
    (tools / "lib").symlink_to(root / "tools/lib")
    (tools / "flash").write_bytes((root / "tools/flash").read_bytes())
    (tools / "flash").chmod(0o755)
    ended = flash(tools.parent, robot, "bone")
    assert ended.returncode == 2 and "tools/package --preset bbb" in ended.stderr
    (tmp_path / "tools/ssh").write_text("#!/bin/sh\nexit 255\n")  # as ssh does when nothing answers
    for arguments in (["--rollback"], ["--package", package(tmp_path, "good")]):
        ended = flash(root, robot, *arguments, "bone")
        assert ended.returncode == 1 and "bone does not answer; try: ssh bone true" in ended.stderr
