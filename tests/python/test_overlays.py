"""The device-tree overlays on the BeagleBone Black's own tree, as the boot loader applies them."""

import subprocess

import pytest

pytestmark = pytest.mark.cross


def compiled(source, output):
    command = ["dtc", "-q", "-@", "-I", "dts", "-O", "dtb", "-o", output, source]
    subprocess.run(command, check=True)
    return output


@pytest.fixture(scope="module")
def board(root):
    """From the kernel's source, made by tools/cross-test."""
    return root / "build/vm/am335x-boneblack.dtb"


@pytest.fixture(scope="module")
def overlays(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("overlays")
    return {
        name: compiled(root / f"packaging/equipoise-{name}.dts", folder / f"{name}.dtbo")
        for name in ("cape", "can")
    }


def merged(board, folder, *overlays):
    output = folder / "merged.dtb"
    ended = subprocess.run(
        ["fdtoverlay", "-i", board, "-o", output, *overlays], capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    return output


def value(tree, label: str, name: str, kind: str = "s") -> str:
    def get(*arguments):
        command = ["fdtget", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    return get("-t", kind, tree, get(tree, "/__symbols__", label), name)


def test_the_cape_turns_on_what_the_board_files_name(board, overlays, tmp_path):
    assert value(board, "eqep1", "status") == "disabled"
    tree = merged(board, tmp_path, overlays["cape"])
    for device in ("eqep0", "eqep1", "eqep2", "ehrpwm1", "ehrpwm2", "epwmss0", "tscadc", "i2c2", "uart1"):
        assert value(tree, device, "status") == "okay", device
    assert value(tree, "i2c2", "clock-frequency", "u") == "400000"


@pytest.mark.parametrize(
    ("device", "driver"),
    [
        ("eqep0", "ti,am3352-eqep"),
        ("ehrpwm1", "ti,am3352-ehrpwm"),
        ("tscadc", "ti,am3359-tscadc"),
        ("dcan1", "ti,am3352-d_can"),
    ],
)
def test_the_devices_have_the_drivers_that_ours_talk_to(board, device, driver):
    assert driver in value(board, device, "compatible").split()


def test_pins_of_a_device_are_its_own_group(board, overlays, tmp_path):
    tree = merged(board, tmp_path, overlays["cape"])
    for device, group in (("eqep1", "equipoise_eqep1_pins"), ("ehrpwm2", "equipoise_pwm2_pins")):
        assert value(tree, device, "pinctrl-0", "u") == value(tree, group, "phandle", "u")
    # <offset configuration mode>, all in the pin controller's range
    cells = [int(cell, 16) for cell in value(tree, "equipoise_gpio_pins", "pinctrl-single,pins", "x").split()]
    assert len(cells) % 3 == 0 and all(0 <= offset <= 0x238 for offset in cells[::3])


def test_can_takes_uart1_away_on_top_of_the_cape(board, overlays, tmp_path):
    tree = merged(board, tmp_path, overlays["cape"], overlays["can"])
    states = {device: value(tree, device, "status") for device in ("uart1", "uart5", "dcan1")}
    assert states == {"uart1": "disabled", "uart5": "okay", "dcan1": "okay"}


def test_a_tree_without_symbols_is_refused(board, overlays, tmp_path):
    bare = tmp_path / "bare.dtb"
    subprocess.run(["cp", board, bare], check=True)
    subprocess.run(["fdtput", "-r", bare, "/__symbols__"], check=True)
    command = ["fdtoverlay", "-i", bare, "-o", tmp_path / "o.dtb", overlays["cape"]]
    assert subprocess.run(command, capture_output=True).returncode != 0
