"""Board files of boards whose overlay is the user's, compared with Debian's own trees: every device is there,
every line is one of the chip's and no enabled device has its pad."""

import re
import subprocess
import tomllib

import pytest
from equipoise_tools import device_tree

# Board file -> tree, what its bus addresses are above the tree's, driver by kind of device.
DRIVERS = {"pwm": "ti,am64-epwm", "encoder": "ti,am62-eqep", "serial": "ti,am64-uart", "adc": "adi,ad7291"}
PI_DRIVERS = {"pwm": "brcm,bcm2835-pwm", "encoder": None, "serial": "brcm,bcm2835-aux-uart", "adc": None}
BOARDS = {
    "pocketbeagle2_edumip": ("debian-7.3-pocketbeagle2", 0, DRIVERS),
    "raspberry_pi4_edumip": ("debian-7.3-rpi-4-b", 0xFE000000 - 0x7E000000, PI_DRIVERS),
}


def compiled(root, name, folder):
    source, output = root / f"tests/data/device_tree/{name}.dts", folder / "tree.dtb"
    subprocess.run(["dtc", "-q", "-I", "dts", "-O", "dtb", "-o", output, source], check=True)
    return device_tree.read(output)


@pytest.fixture(params=BOARDS)
def board(request, root):
    return request.param, tomllib.loads((root / f"config/boards/{request.param}.toml").read_text())


@pytest.fixture
def tree(board, root, tmp_path):
    return compiled(root, BOARDS[board[0]][0], tmp_path)


def lines_of(board):
    """(name, chip, line)"""
    found = [(key, *board["leds"][key]) for key in ("red", "green")]
    found += [("bar", *pin) for pin in board["leds"]["bars"]]
    found += [(key, *board["buttons"][key]) for key in ("pause", "mode")] + [
        ("enable", *board["bridges"]["enable"])
    ]
    return found + [(key, *motor[key]) for motor in board["motor"] for key in ("in1", "in2")]


def at(tree, name, above):
    """The node whose device the kernel names `name`."""
    address = f"@{int(name, 16) - above:x}"
    (node,) = [n for n in tree.walk() if n.path.endswith(address)]
    return node


def taken(tree):
    """(path of a GPIO chip or of a pin controller, pin) of what enabled devices claim."""
    groups = {n.cells("phandle")[0]: n for n in tree.walk() if "phandle" in n.properties}
    found = {}
    for device in tree.walk():
        for phandle in device.cells("pinctrl-0") if device.enabled else []:
            group = groups.get(phandle)
            for each in group.walk() if group else []:
                rows = [pad // 4 for pad in each.cells("pinctrl-single,pins")[::2]] + each.cells("brcm,pins")
                found |= {(group.parent.path, pin): device.path for pin in rows}
    return found


def pin_of(tree, chip, line):
    """Where gpio-ranges (controller, first line, first pin, count) put a line."""
    cells = chip.cells("gpio-ranges")
    controllers = {n.cells("phandle")[0]: n.path for n in tree.walk() if "phandle" in n.properties}
    (found,) = [
        (controllers[phandle], first_pin + line - first)
        for phandle, first, first_pin, count in zip(*[iter(cells)] * 4, strict=True)
        if first <= line < first + count
    ]
    return found


def test_its_lines_are_free_and_each_is_used_once(board, tree):
    name, file = board
    above, claims = BOARDS[name][1], taken(tree)
    assert claims, "the tree claims nothing: nothing was compared"
    used = {}
    for what, chip, line in lines_of(file):
        pin = pin_of(tree, at(tree, chip, above), line)
        assert pin not in claims, f"{what}: {claims.get(pin)} has {chip} {line}"
        assert pin not in used, f"{what} and {used.get(pin)} share {chip} {line}"
        used[pin] = what


def test_its_devices_are_in_the_tree_with_the_drivers_that_serve_them(board, tree):
    name, file = board
    _, above, drivers = BOARDS[name]
    devices = [("serial", file["serial"]["device"])]
    devices += [(key, motor[key]) for motor in file["motor"] for key in ("pwm", "encoder")]
    for kind, device in devices:
        if drivers[kind]:
            assert at(tree, device, above).text("compatible") == drivers[kind], device
    assert at(tree, file["serial"]["device"], above).enabled
    enabled = [n.text("compatible") for n in tree.walk() if n.enabled]
    assert drivers["adc"] is None or drivers["adc"] in enabled


def test_the_heads_say_what_is_off_in_the_tree_and_that_no_board_has_run(board, tree, root):
    name, file = board
    above = BOARDS[name][1]
    head = (root / f"config/boards/{name}.toml").read_text().split("[board]")[0]
    assert "Never run on a board" in head.replace("\n# ", " ") and "CONFIG_COUNTER" in head
    off = [at(tree, motor["pwm"], above).enabled for motor in file["motor"]]
    assert not any(off) and "switches on" in head


def test_a_pis_lines_and_pwm_are_what_the_file_says(root, tmp_path):
    board = tomllib.loads((root / "config/boards/raspberry_pi4_edumip.toml").read_text())
    tree = compiled(root, "debian-7.3-rpi-4-b", tmp_path)
    above = BOARDS["raspberry_pi4_edumip"][1]
    for what, chip, line in lines_of(board):
        names = at(tree, chip, above).properties["gpio-line-names"].decode().split("\0")
        assert names[line] == f"GPIO{line}", what
        assert line not in (2, 3, *range(7, 14)), f"{what} is I2C1's, SPI0's or the PWM's"
    (clock_hz,) = at(tree, board["motor"][0]["pwm"], above).cells("assigned-clock-rates")
    assert clock_hz / board["bridges"]["pwm_hz"] == 500


def test_it_goes_with_the_edumips_configuration_but_for_the_battery(board, root, tmp_path):
    name, file = board
    text = (root / "config/edumip.toml").read_text()
    for key, value in (("V_per_count", file["battery"]["V_per_count"]), ("offset_V", 0.0)):
        text, count = re.subn(rf"^battery_{key} = \S+", f"battery_{key} = {value}", text, flags=re.M)
        assert count == 1
    config = tmp_path / "edumip.toml"
    config.write_text(text)
    command = [root / "build/host/equipoise", "calibrate", "gyro", "--backend", "stand", "--config"]
    out = ["--out", tmp_path / "calibration.toml"]
    for given, status in ((config, 0), (root / "config/edumip.toml", 2)):
        ended = subprocess.run(
            [*command, given, "--board", root / f"config/boards/{name}.toml", *out],
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
        assert ended.returncode == status, ended.stderr
    assert "battery.V_per_count" in ended.stderr
