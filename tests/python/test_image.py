"""The SD card's image: its user says who may log in, and what its parts name exists.
That it boots to its service is shown by tools/vm-test image."""

import re
import subprocess

import pytest
from equipoise_tools import device_tree


def image(root, *arguments):
    return subprocess.run([root / "tools/image", *arguments], capture_output=True, text=True)


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ([], "who may log in"),
        (["--ssh-key", "/nonexistent/key.pub"], "/nonexistent/key.pub: no such file"),
        (["--no-login", "--size-mb", "big"], "--size-mb big"),
        (["--key-later", "--size-mb", "0"], "--size-mb 0"),
        (["--no-login", "--card"], "unknown argument '--card'"),
        (["--no-login", "--output", "/dev/null"], "--output /dev/null: exists and is no file"),
    ],
)
def test_bad_usage_is_one_line_before_anything_is_built(root, arguments, complaint):
    ended = image(root, *arguments)
    assert ended.returncode == 2 and ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1 and complaint in ended.stderr


def test_only_an_image_of_a_robot_is_replaced(root, tmp_path):
    """Not the copy of another card either, which has a boot sector, too."""
    notes, card = tmp_path / "notes", tmp_path / "card.img"
    notes.write_text("mine\n" * 200)
    card.write_bytes(bytes(510) + b"\x55\xaa" + bytes(5 << 20))
    for other in (notes, card):
        ended = image(root, "--no-login", "--output", str(other), "--size-mb", "none")  # builds nothing
        assert ended.returncode == 2 and f"--output {other}: exists and is no image" in ended.stderr
    ours = tmp_path / "ours.img"
    with ours.open("wb") as file:
        file.truncate(8 << 20)
    at = f"offset={4 << 20}"
    subprocess.run(
        ["/sbin/mke2fs", "-qF", "-t", "ext4", "-L", "equipoise", "-E", at, ours, "2048k"], check=True
    )
    ended = image(root, "--output", str(ours), "--size-mb", "none", "--no-login")
    assert ended.returncode == 2 and "--size-mb none" in ended.stderr, ended.stderr


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


def test_the_console_is_the_port_that_debians_kernel_has(root):
    """SERIAL_OMAP, not SERIAL_8250_OMAP: ttyO0."""
    loader = (root / "packaging/image/extlinux.conf").read_text()
    lines = re.findall(r"^\s*append (.*)$", loader, re.M)
    assert len(lines) == 2
    assert all("console=ttyO0,115200" in line and "default_governor=performance" in line for line in lines)


def test_the_cards_own_module_list_does_not_hide_the_packages(root):
    """A file of the same name in /etc would take the place of the one in /usr/lib."""
    package = re.search(r"usr/lib/modules-load\.d/(\S+)", (root / "tools/package").read_text())[1]
    card = re.search(r"etc/modules-load\.d/(\S+)\"", (root / "packaging/image/customize").read_text())[1]
    assert package != card
    assert "i2c-dev" in (root / "packaging/modules.conf").read_text().split()
    # What the image must load by itself, its test does not load for it.
    assert "i2c-dev" not in (root / "tests/hardware/image/bench").read_text()


@pytest.mark.cross
def test_the_cards_initramfs_holds_what_its_tree_asks_for(root):
    kernel = next((root / "build/vm/kernel-armhf/lib/modules").iterdir())
    subprocess.run(["depmod", "-b", root / "build/vm/kernel-armhf", kernel.name], check=True)
    modules = device_tree.drivers(
        device_tree.read(root / "build/vm/bookworm-boneblack.dtb"), (kernel / "modules.alias").read_text()
    )
    assert {"sdhci_omap", "omap_wdt", "tps65217"} <= set(modules)
    found = {path.stem.replace("-", "_") for path in kernel.rglob("*.ko")}
    built_in = (kernel / "modules.builtin").read_text().split()
    found |= {name.rsplit("/", 1)[1].removesuffix(".ko").replace("-", "_") for name in built_in}
    assert set(modules) <= found
    assert {
        "mmc_block",
        "ext4",
        "crc32c_generic",
        "virtio_pci",
        "virtio_blk",
    } <= found  # tools/image adds them


def test_the_service_of_a_fresh_card_waits_for_its_owner(root):
    enabled = re.search(r"systemctl enable (.*)", (root / "packaging/image/customize").read_text())[1].split()
    assert "equipoise" not in enabled
