"""One version everywhere; the bill of materials names what is depended on; a dirty tree is refused."""

import json
import os
import re
import shutil
import subprocess
from datetime import UTC, datetime

import pytest
import yaml
from equipoise_tools import sbom


def version_of(root) -> str:
    return re.search(r"project\(equipoise VERSION ([\d.]+)", (root / "CMakeLists.txt").read_text())[1]


def test_the_version_is_the_same_everywhere(root):
    version = version_of(root)
    assert (root / "packaging/changelog").read_text().startswith(f"equipoise ({version}) ")
    assert f"\nversion: {version}\n" in (root / "CITATION.cff").read_text()
    assert f"\n## {version}" in (root / "CHANGELOG.md").read_text()
    said = subprocess.run(
        [root / "build/host/equipoise", "--version"], capture_output=True, text=True, check=True
    )
    assert version in said.stdout


def test_the_bill_names_libraries_python_and_javascript(root, tmp_path):
    if not shutil.which("dpkg-deb"):
        pytest.skip("dpkg-deb is not installed")
    tree = tmp_path / "tree/DEBIAN"
    tree.mkdir(parents=True)
    (tree / "control").write_text(
        "Package: x\nVersion: 1\nArchitecture: all\nMaintainer: x <x@example.com>\n"
        "Depends: adduser, libsodium23 (>= 1.0.18), libc6 (>= 2.36) | libc6-udeb\nDescription: x\n"
    )
    subprocess.run(
        ["dpkg-deb", "--build", tmp_path / "tree", tmp_path / "x.deb"], check=True, capture_output=True
    )
    bill = sbom.bill("1.2.3", [tmp_path / "x.deb"], root, datetime(2026, 1, 2, tzinfo=UTC))
    assert bill == json.loads(json.dumps(bill))
    versions = {item["purl"].partition("@")[0]: item["version"] for item in bill["components"]}
    assert versions["pkg:deb/debian/libsodium23"] == ">= 1.0.18"
    assert versions["pkg:deb/debian/libc6"] == ">= 2.36"
    locked = json.loads((root / "tools/page/package-lock.json").read_text())["packages"]
    assert versions["pkg:npm/three"] == locked["node_modules/three"]["version"]
    assert "pkg:pypi/numpy" in versions
    assert bill["metadata"]["component"]["version"] == "1.2.3"
    again = sbom.bill("1.2.3", [tmp_path / "x.deb"], root, datetime(2026, 1, 2, tzinfo=UTC))
    assert again["serialNumber"] == bill["serialNumber"]


@pytest.fixture
def clone(root, tmp_path):
    """A repository with the release script alone."""
    tree = tmp_path / "clone"
    (tree / "tools/lib").mkdir(parents=True)
    for name in ("tools/release", "tools/lib/setup.sh", "CMakeLists.txt", "CITATION.cff"):
        shutil.copy(root / name, tree / name)
    (tree / "packaging").mkdir()
    shutil.copy(root / "packaging/changelog", tree / "packaging")
    environment = {**os.environ, "GIT_CONFIG_GLOBAL": os.devnull}
    for command in (
        ["init", "-q"],
        ["add", "-A"],
        ["-c", "user.name=x", "-c", "user.email=x", "commit", "-qm", "x"],
    ):
        subprocess.run(["git", *command], cwd=tree, check=True, env=environment)
    return tree


def release(tree, *arguments):
    return subprocess.run([tree / "tools/release", *arguments], capture_output=True, text=True, check=False)


def test_a_release_refuses_uncommitted_changes_and_other_versions(clone):
    (clone / "new").write_text("")
    refused = release(clone)
    assert refused.returncode == 1 and "uncommitted changes" in refused.stderr
    (clone / "CITATION.cff").write_text("version: 9.9.9\n")
    refused = release(clone)
    assert refused.returncode == 1 and "CITATION.cff names version 9.9.9" in refused.stderr
    assert release(clone, "--preset", "sparc").returncode == 2


@pytest.mark.parametrize("command", ["release", "sysroot"])
def test_a_folder_of_something_else_is_not_replaced(clone, root, tmp_path, command):
    shutil.copy(root / "tools/lib/foreign_apt.sh", clone / "tools/lib")
    shutil.copy(root / f"tools/{command}", clone / "tools")
    for occupied in ("thesis", "new.new"):
        (tmp_path / occupied).mkdir()
        (tmp_path / occupied / "chapter").write_text("mine")
    for output in (tmp_path / "thesis", *[tmp_path / "new"][: command == "sysroot"]):
        asked = [clone / "tools" / command, "--output", output]
        refused = subprocess.run(asked, capture_output=True, text=True)
        assert refused.returncode == 2 and "was not made by this command" in refused.stderr
    assert (tmp_path / "thesis/chapter").exists() and (tmp_path / "new.new/chapter").exists()


def test_the_hosted_workflow_runs_the_commands_of_the_readme(root):
    jobs = yaml.safe_load((root / ".github/workflows/test.yml").read_text())["jobs"]
    run = [
        step.get("run", "").split()[0]
        for step in jobs["test"]["steps"]
        if step.get("run", "").startswith("./")
    ]
    assert run == ["./tools/run", "./tools/test"]
    assert all(f"{command}" in (root / "README.md").read_text() for command in run)
    assert any(step.get("run", "").startswith("./tools/release") for step in jobs["release"]["steps"])


def test_the_packages_of_boards_find_what_tools_sysroot_made(clone):
    """Libraries, and the packages they came in, which name what the robot's package depends on."""
    for name, text in {
        "tools/sysroot": 'mkdir -p "$(dirname "$0")/../build/"{sysroot,apt/bookworm-armhf}\n',
        "tools/package": 'ls -d "$(dirname "$0")/../build/"{sysroot,apt/bookworm-armhf} >&2\nfalse\n',
        ".gitignore": "build/\n",
    }.items():
        (clone / name).write_text(f"#!/bin/bash\n{text}")
        (clone / name).chmod(0o755)
    environment = {**os.environ, "GIT_CONFIG_GLOBAL": os.devnull}
    for command in (["add", "-A"], ["-c", "user.name=x", "-c", "user.email=x", "commit", "-qm", "y"]):
        subprocess.run(["git", *command], cwd=clone, check=True, env=environment)
    ended = release(clone, "--preset", "bbb")
    assert "tools/package --preset bbb failed" in ended.stderr
    assert "No such file" not in ended.stderr, ended.stderr
