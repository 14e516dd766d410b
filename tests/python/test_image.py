"""The SD card's image: its user says who may log in, and what its parts name exists.
That it boots to its service is shown by tools/vm-test image."""

import re
import subprocess

import pytest


def image(root, *arguments):
    return subprocess.run([root / "tools/image", *arguments], capture_output=True, text=True)


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ([], "who may log in"),
        (["--ssh-key", "/nonexistent/key.pub"], "/nonexistent/key.pub: no such file"),
        (["--no-login", "--size-mb", "big"], "--size-mb big"),
        (["--no-login", "--card"], "unknown argument '--card'"),
    ],
)
def test_bad_usage_is_one_line_before_anything_is_built(root, arguments, complaint):
    ended = image(root, *arguments)
    assert ended.returncode == 2 and ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1 and complaint in ended.stderr


def test_a_private_key_is_refused(root, tmp_path):
    (tmp_path / "id").write_text("-----BEGIN OPENSSH PRIVATE KEY-----\n")
    ended = image(root, "--ssh-key", str(tmp_path / "id"))
    assert ended.returncode == 2 and "not a public key" in ended.stderr


def test_the_loader_finds_what_the_image_holds(root):
    loader = (root / "packaging/image/extlinux.conf").read_text()
    script = (root / "tools/image").read_text()
    trees = set(re.findall(r"fdt /boot/(\S+)", loader))
    assert trees == set(re.findall(r"contents/(equipoise\S*\.dtb)", script)) and len(trees) == 2
    label = re.search(r"-L (\S+)", script)[1]
    assert set(re.findall(r"root=LABEL=(\S+)", loader)) == {label}
    customize = (root / "packaging/image/customize").read_text()
    assert f"LABEL={label} / ext4" in customize
    for name in re.findall(r"^put \d+ (\S+)", customize, re.M):
        assert list((root / "packaging/image").glob(name.replace("$network", "*"))), name


def test_the_service_of_a_fresh_card_waits_for_its_owner(root):
    enabled = re.search(r"systemctl enable (.*)", (root / "packaging/image/customize").read_text())[1].split()
    assert "equipoise" not in enabled
