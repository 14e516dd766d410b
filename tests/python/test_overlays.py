"""The device-tree overlays on the boards' own trees, as the boot loader applies them.
Debian's are compiled from its kernels' source by tools/cross-test; of BeagleBoard.org's what is about pads is
in tests/data/device_tree."""

import subprocess

import pytest
from equipoise_tools import device_tree

DEBIAN = [("bookworm", 2), ("trixie", 2)]
CAPE_ON_BEAGLE = [("beagle-4.19-boneblack", 1), ("beagle-5.10-boneblack", 1), ("beagle-6.6-boneblack", 2)]
CARD_DETECT = 0x160


def compiled(source, output):
    command = ["dtc", "-q", "-@", "-I", "dts", "-O", "dtb", "-o", output, source]
    subprocess.run(command, check=True)
    return output


@pytest.fixture(scope="module")
def overlay(root, tmp_path_factory):
    """overlay(name, cells): as tools/package and tools/image compile it."""
    folder = tmp_path_factory.mktemp("overlays")

    def make(name, cells):
        output = folder / f"{name}-{cells}.dtbo"
        script = f"root={root}; source {root}/tools/lib/overlays.sh; compile_overlay {name} {cells} {output}"
        subprocess.run(["bash", "-euc", script], check=True)
        return output

    return make


@pytest.fixture
def tree(root, tmp_path):
    """tree(name): compiled; of Debian's only after tools/cross-test has made them."""

    def make(name):
        source = root / f"tests/data/device_tree/{name}.dts"
        return (
            compiled(source, tmp_path / f"{name}.dtb") if source.exists() else root / f"build/vm/{name}.dtb"
        )

    return make


def apply(board, folder, *overlays):
    output = folder / "merged.dtb"
    command = ["fdtoverlay", "-i", board, "-o", output, *overlays]
    return subprocess.run(command, capture_output=True, text=True), output


def merged(board, folder, *overlays):
    ended, output = apply(board, folder, *overlays)
    assert ended.returncode == 0, ended.stderr
    return device_tree.read(output)


def labelled(root_node, label):
    path = root_node.children["__symbols__"].text(label)
    return next(node for node in root_node.walk() if node.path == path)


def check_cape(root_node):
    """No pad twice, every row a pad, our lines the pin controller's own, every device of a board file on."""
    assert device_tree.findings(root_node) == []
    hog = labelled(root_node, "am33xx_pinmux")
    ours = {claim.pad: claim for claim in device_tree.claims(root_node) if claim.device == hog.path}
    assert len(ours) == 19
    # Bridges, directions: pulled down, receiver off, mode 7; a fault line: pulled up, receiver on.
    for pad in (0x1B4, 0x078, 0x074, 0x040, 0x0CC, 0x0AC, 0x0A8):
        assert (ours[pad].configuration, ours[pad].mode) == (0x00, 7), hex(pad)
    assert (ours[0x044].configuration, ours[0x044].mode) == (0x30, 7)
    for device in ("eqep0", "eqep1", "eqep2", "ehrpwm1", "ehrpwm2", "epwmss0", "tscadc", "i2c2"):
        assert labelled(root_node, device).text("status") == "okay", device
    bus = {c.pad: (c.configuration, c.mode) for c in device_tree.claims(root_node) if c.pad in (0x178, 0x17C)}
    assert set(bus) == {0x178, 0x17C} and all(at & 0x20 and mode == 3 for at, mode in bus.values())
    pwm = {c.pad: c for c in device_tree.claims(root_node) if c.device == labelled(root_node, "ehrpwm1").path}
    assert {(c.configuration, c.mode) for c in pwm.values()} == {(0x00, 6)} and set(pwm) == {0x048, 0x04C}


@pytest.mark.parametrize(("board", "cells"), CAPE_ON_BEAGLE)
@pytest.mark.parametrize("can", [False, True])
def test_on_beagleboards_trees_no_pad_is_claimed_twice(tree, overlay, tmp_path, board, cells, can):
    names = ["cape", "can"] if can else ["cape"]
    root_node = merged(tree(board), tmp_path, *(overlay(name, cells) for name in names))
    check_cape(root_node)
    assert labelled(root_node, "uart1").text("status") == ("disabled" if can else "okay")


@pytest.mark.cross
@pytest.mark.parametrize(("suite", "cells"), DEBIAN)
@pytest.mark.parametrize("can", [False, True])
def test_on_debians_trees_no_pad_is_claimed_twice(tree, overlay, tmp_path, suite, cells, can):
    names = ["cape", "no-hdmi", "can"] if can else ["cape", "no-hdmi"]
    root_node = merged(tree(f"{suite}-boneblack"), tmp_path, *(overlay(name, cells) for name in names))
    check_cape(root_node)
    states = {name: labelled(root_node, name).text("status") for name in ("uart1", "uart5", "dcan1", "lcdc")}
    wanted = ("disabled", "okay", "okay") if can else ("okay", "disabled", "disabled")
    assert states == dict(zip(("uart1", "uart5", "dcan1", "lcdc"), (*wanted, "disabled"), strict=True))
    assert labelled(root_node, "i2c2").cells("clock-frequency") == [400000]
    card = [claim for claim in device_tree.claims(root_node) if claim.pad == CARD_DETECT]
    assert [claim.device for claim in card] == [labelled(root_node, "mmc1").path]


@pytest.mark.cross
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
@pytest.mark.parametrize(
    ("device", "driver"),
    [
        ("eqep0", "ti,am3352-eqep"),
        ("ehrpwm1", "ti,am3352-ehrpwm"),
        ("tscadc", "ti,am3359-tscadc"),
        ("dcan1", "ti,am3352-d_can"),
    ],
)
def test_the_devices_have_the_drivers_that_ours_talk_to(tree, suite, device, driver):
    node = labelled(device_tree.read(tree(f"{suite}-boneblack")), device)
    assert driver in node.properties["compatible"].decode().split("\0")


BLUE = [
    ("beagle-5.10-boneblue", 1),
    *(pytest.param(f"{suite}-boneblue", 2, marks=pytest.mark.cross) for suite in ("bookworm", "trixie")),
]


@pytest.mark.parametrize(("board", "cells"), BLUE)
def test_the_blue_gets_its_motors_and_its_imu(tree, overlay, tmp_path, board, cells):
    root_node = merged(tree(board), tmp_path, overlay("blue", cells))
    assert device_tree.findings(root_node) == []
    hog = labelled(root_node, "am33xx_pinmux").path
    ours = {claim.pad: claim.configuration for claim in device_tree.claims(root_node) if claim.device == hog}
    assert len(ours) == 12 and all(ours[pad] == 0 for pad in (0x1B4, 0x040, 0x0D8, 0x0AC, 0x0A8))
    i2c2 = labelled(root_node, "i2c2")
    imus = [node for name, node in i2c2.children.items() if name.endswith("@68")]
    assert [node.enabled for node in imus] == [False]  # the kernel's driver would hold its address
    for device in ("eqep1", "eqep2", "ehrpwm1", "ehrpwm2", "dcan1", "tscadc"):
        assert labelled(root_node, device).enabled, device
    radio = [claim.mode for claim in device_tree.claims(root_node) if claim.pad == 0x070]
    assert radio == [6]  # UART4 receives from the DSM port


@pytest.mark.cross
@pytest.mark.parametrize("board", ["boneblack", "boneblue"])
def test_the_compiled_tree_is_the_one_in_debians_kernel_package(root, board):
    """Apart from what -@ adds, which moves the phandles."""
    packaged = next((root / "build/vm/kernel-armhf/usr/lib").glob(f"linux-image-*/am335x-{board}.dtb"))
    trees = [device_tree.read(path) for path in (packaged, root / f"build/vm/bookworm-{board}.dtb")]
    assert device_tree.claims(trees[0]) == device_tree.claims(trees[1]) != []


# --- faults that these tests are there to find


def test_hdmi_left_on_is_found(root, tree, overlay, tmp_path):
    """uEnv.txt without disable_uboot_overlay_video and _audio."""
    hdmi = compiled(root / "tests/data/device_tree/beagle-5.10-hdmi.dtso", tmp_path / "hdmi.dtbo")
    clashes = device_tree.conflicts(merged(tree("beagle-5.10-boneblack"), tmp_path, hdmi, overlay("cape", 1)))
    assert set(clashes) == {0x0A8, 0x0AC, 0x0CC, 0x0D0, 0x0D4, 0x19C, 0x1AC}


def test_the_universal_cape_left_on_is_found(tree, overlay, tmp_path):
    """uEnv.txt with enable_uboot_cape_universal=1: a helper claims every pad of the headers."""
    clashes = device_tree.conflicts(merged(tree("beagle-5.10-boneblack-univ"), tmp_path, overlay("cape", 1)))
    assert len(clashes) == 19 + 6 + 4 + 2  # lines, encoders, PWM, UART1: all of ours


@pytest.mark.parametrize(
    ("board", "right"),
    [("beagle-5.10-boneblack", 1), ("beagle-6.6-boneblack", 2), ("beagle-5.10-boneblue", 1)],
)
def test_the_twin_for_the_other_kind_of_pin_controller_is_found(tree, overlay, tmp_path, board, right):
    name = "blue" if "blue" in board else "cape"
    wrong = merged(tree(board), tmp_path, overlay(name, 3 - right))  # applies without an error
    assert device_tree.findings(wrong) != []
    with pytest.raises(device_tree.UserError, match=r"no pad|no rows of"):
        device_tree.claims(wrong)


FIRST_BANK = """/dts-v1/;
/plugin/;
&am33xx_pinmux {
	lines: lines { pinctrl-single,pins = <0x1b4 0x00 7 0x078 0x00 7>; };
};
&gpio0 { pinctrl-0 = <&lines>; };
"""


@pytest.mark.cross
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
def test_lines_on_the_first_gpio_bank_as_they_once_were_are_found(tree, tmp_path, suite):
    """Debian's tree has a clock output on P9.41: gpio0 does not probe, and with it the card's detect line."""
    (tmp_path / "once.dts").write_text(FIRST_BANK)
    once = compiled(tmp_path / "once.dts", tmp_path / "once.dtbo")
    clashes = device_tree.conflicts(merged(tree(f"{suite}-boneblack"), tmp_path, once))
    assert list(clashes) == [0x1B4]


@pytest.mark.cross
@pytest.mark.parametrize("suite", ["bookworm", "trixie"])
def test_hdmi_of_debians_tree_left_on_is_found(tree, overlay, tmp_path, suite):
    clashes = device_tree.conflicts(merged(tree(f"{suite}-boneblack"), tmp_path, overlay("cape", 2)))
    assert set(clashes) == {0x0A8, 0x0AC, 0x0CC, 0x0D0, 0x0D4, 0x19C, 0x1AC}


def test_a_tree_without_symbols_is_refused(tree, overlay, tmp_path):
    bare = tree("beagle-5.10-boneblack")
    subprocess.run(["fdtput", "-r", bare, "/__symbols__"], check=True)
    ended, _ = apply(bare, tmp_path, overlay("cape", 1))
    assert ended.returncode != 0


def test_the_command_says_which_pads_clash(root, tree, overlay, tmp_path, capsys):
    board = tree("beagle-5.10-boneblack-univ")
    merged(board, tmp_path, overlay("cape", 1))
    assert device_tree.main([str(tmp_path / "merged.dtb")]) == 1
    assert "pad 0x1b4: " in capsys.readouterr().out
    assert device_tree.main([str(board)]) == 0
    assert device_tree.main([str(root / "README.md")]) == 2
    assert "not a flattened device tree" in capsys.readouterr().err
