"""What the Debian package holds; and that the service manager hears the firmware."""

import os
import re
import shutil
import socket
import subprocess
from fnmatch import fnmatch

import pytest
from equipoise_tools.lockstep_client import Robot
from test_doctor import PADS
from test_lockstep import Firmware, step


def overlay_pads(root, name: str) -> dict[int, tuple[int, int]]:
    """Pad -> (configuration, mode) of an overlay's source."""
    text = (root / f"packaging/equipoise-{name}.dts").read_text()
    configurations = {"OUT_LOW": 0x00, "OUT_HIGH": 0x10, "IN_HIGH": 0x30}
    rows = re.findall(r"^\t+PAD\((0x\w+), (\w+), (\d)\)", text, re.M)
    return {0x800 + int(at, 16): (configurations[name], int(mode)) for at, name, mode in rows}


@pytest.mark.parametrize("name", ["cape", "can", "blue", "no-hdmi"])
@pytest.mark.parametrize("cells", [1, 2])
def test_overlays_compile_without_a_warning(root, tmp_path, name, cells):
    if not shutil.which("dtc"):
        pytest.skip("device-tree-compiler is not installed")
    source = root / f"packaging/equipoise-{name}.dts"
    command = ["cpp", "-nostdinc", "-undef", "-x", "assembler-with-cpp", f"-DPINCTRL_CELLS={cells}", source]
    plain = subprocess.run(command, capture_output=True, text=True, check=True)
    command = ["dtc", "-@", "-I", "dts", "-O", "dtb", "-o", tmp_path / "o.dtbo", "-"]
    ended = subprocess.run(command, input=plain.stdout, capture_output=True, text=True)
    assert ended.returncode == 0 and ended.stderr == ""
    assert (tmp_path / "o.dtbo").stat().st_size > 300


@pytest.mark.parametrize("cells", [1, 2])
def test_the_package_chooses_the_overlays_that_fit_the_running_kernel(root, tmp_path, cells):
    firmware = tmp_path / "lib/firmware"
    firmware.mkdir(parents=True)
    for name in ("cape", "can", "blue"):
        for kind in (1, 2):
            (firmware / f"equipoise-{name}-{kind}cell.dtbo").write_text(f"{name} {kind}")
    choose = [root / "packaging/choose-overlays", tmp_path]
    assert subprocess.run(choose, capture_output=True, text=True, check=True).stdout == ""  # a laptop
    assert not (firmware / "equipoise-cape.dtbo").exists()
    scm = tmp_path / "proc/device-tree/ocp/scm@0"
    (scm / "pinmux@800").mkdir(parents=True)
    (scm / "#pinctrl-cells").write_bytes(bytes([0, 0, 0, 1]))  # another controller's
    (scm / "pinmux@800/#pinctrl-cells").write_bytes(bytes([0, 0, 0, cells]))
    assert subprocess.run(choose, capture_output=True, text=True, check=True).stdout == f"{cells}\n"
    for name in ("cape", "can", "blue"):
        assert (firmware / f"equipoise-{name}.dtbo").read_text() == f"{name} {cells}"
    (scm / "pinmux@800/#pinctrl-cells").write_bytes(bytes([0, 0, 0, 3]))  # what no overlay is made for
    ended = subprocess.run(choose, capture_output=True, text=True, check=True)
    assert ended.stderr.count("#pinctrl-cells = <3>") == 3
    assert not [file for file in firmware.iterdir() if "cell" not in file.name]


def test_interrupt_threads_of_the_robot_come_before_those_of_ethernet_and_mmc(root, tmp_path):
    names = {
        11: "irq/45-4819c000.i2c",
        12: "irq/60-481ae000",  # a kernel that cuts names
        13: "irq/61-equipoise",
        21: "irq/50-4a100000.ethernet",
        22: "irq/51-48060000.mmc",
        23: "equipoise",
    }
    for number, name in names.items():
        (tmp_path / f"proc/{number}").mkdir(parents=True)
        (tmp_path / f"proc/{number}/comm").write_text(f"{name}\n")
    (tmp_path / "proc/31").mkdir()  # a program that gave itself the name of one
    (tmp_path / "proc/31/comm").write_text("irq/52-4819c000\n")
    (tmp_path / "proc/31/exe").symlink_to("/bin/true")
    governor = tmp_path / "sys/devices/system/cpu/cpufreq/policy0/scaling_governor"
    governor.parent.mkdir(parents=True)
    governor.write_text("schedutil\n")
    tools = tmp_path / "bin"
    tools.mkdir()
    (tools / "chrt").write_text(f'#!/bin/sh\necho "$*" >>{tmp_path}/raised\n')
    (tools / "chrt").chmod(0o755)
    command = [root / "packaging/real-time-machine", tmp_path]
    variables = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    assert subprocess.run(command, env=variables, capture_output=True).returncode == 0
    assert (tmp_path / "raised").read_text().splitlines() == ["-f -p 70 11", "-f -p 70 12", "-f -p 85 13"]
    assert governor.read_text() == "performance\n"


def test_the_overlay_switches_every_pad_as_the_doctor_expects(root):
    pads = overlay_pads(root, "cape")
    for pad, value in PADS.items():
        if pad in (0x978, 0x97C):
            continue  # I2C2: right in every board's own tree, see test_overlays.py
        configuration, mode = pads[pad]
        assert mode == value & 7, hex(pad)
        assert configuration & 0x20 == value & 0x20, f"receiver of {pad:#x}"
    assert pads[0x9B4] == (0x00, 7)  # bridge enable: pulled down while nobody drives it
    text = (root / "packaging/equipoise-cape.dts").read_text()
    for device in ("eqep0", "eqep1", "eqep2", "ehrpwm1", "ehrpwm2", "tscadc", "uart1", "i2c2"):
        assert re.search(rf'^&{device} {{\n\tstatus = "okay";', text, re.M), device


def test_can_takes_the_pads_of_uart1(root):
    assert overlay_pads(root, "can") == {
        0x980: (0x10, 2),
        0x984: (0x30, 2),
        0x8C0: (0x10, 4),
        0x8C4: (0x30, 4),
    }
    text = (root / "packaging/equipoise-can.dts").read_text()
    assert '&uart1 {\n\tstatus = "disabled"' in text and '&dcan1 {\n\tstatus = "okay"' in text


def test_the_service_is_understood_and_gives_what_the_doctor_asks_for(root, tmp_path):
    unit = (root / "packaging/equipoise.service").read_text()
    for line in ("Type=notify", "WatchdogSec=2", "LimitRTPRIO=99", "LimitMEMLOCK=infinity", "Restart=no"):
        assert f"\n{line}\n" in unit
    allowed = set(re.findall(r"^DeviceAllow=char-(\S+) ", unit, re.M))
    assert allowed >= {"i2c", "iio", "gpiochip", "ttyS", "ttyO", "input"}  # what the drivers open
    after = re.search(r"^ExecStopPost=/bin/sh -c '(.*)'$", unit, re.M)[1].replace("$$", "$")
    for channel in ("pwm0", "pwm-7:1"):
        (tmp_path / "pwmchip7" / channel).mkdir(parents=True)
        (tmp_path / "pwmchip7" / channel / "enable").write_text("1")
    subprocess.run(["/bin/sh", "-c", after.replace("/sys/class/pwm", str(tmp_path))], check=True)
    assert [f.read_text() for f in tmp_path.glob("pwmchip7/*/enable")] == ["0\n", "0\n"]
    options = re.findall(r" (--[a-z-]+)", re.search(r"^ExecStart=.*$", unit, re.M)[0])
    help_text = subprocess.run(
        [root / "build/host/equipoise", "run", "--help"], capture_output=True, text=True
    ).stdout
    assert options and all(option in help_text for option in options)
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd is not installed")
    # As installed, but with programs and a manual page that exist here.
    text = re.sub(r"/usr/(bin/equipoise|lib/equipoise/\S+)", "/bin/true", unit)
    text = text.replace("Documentation=man:equipoise(1)\n", "")
    (tmp_path / "equipoise.service").write_text(text)
    command = ["systemd-analyze", "verify", "--man=no", tmp_path / "equipoise.service"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert "equipoise.service" not in ended.stderr, ended.stderr
    sandbox = ["systemd-analyze", "security", "--offline=yes", "--no-pager", "--threshold=40"]
    ended = subprocess.run([*sandbox, tmp_path / "equipoise.service"], capture_output=True, text=True)
    assert ended.returncode == 0, "exposure 4.0 or more:" + ended.stdout[-4000:]


def test_run_tells_the_service_manager_that_it_is_ready_and_alive(root, tmp_path):
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(tmp_path / "notify"))
    manager.settimeout(20)
    environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "200000"}
    firmware = Firmware(root, tmp_path, "--timeout-s", "20", env=environment)
    with firmware.connect() as connection:
        manager.setblocking(False)
        with pytest.raises(BlockingIOError):  # not before the first tick
            manager.recv(100)
        manager.settimeout(20)
        robot = Robot(0.01)
        step(connection, robot, 0)
        assert manager.recv(100) == b"READY=1\nWATCHDOG=1"
        step(connection, robot, 1)
        assert manager.recv(100) == b"WATCHDOG=1"
        manager.settimeout(0.5)  # ten beats' time: a loop that hangs is silent
        with pytest.raises(TimeoutError):
            manager.recv(100)
    firmware.process.terminate()
    firmware.end()
    manager.settimeout(20)
    assert manager.recv(100) == b"STOPPING=1"


def packed(root, tmp_path, *arguments: str) -> tuple[str, str]:
    """The package's path and its fields; its contents are in tmp_path / "tree"."""
    ended = subprocess.run(
        [root / "tools/package", "--output", tmp_path, *arguments],
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert ended.returncode == 0, ended.stderr  # lintian among it
    package = ended.stdout.strip()
    fields = subprocess.run(["dpkg-deb", "--field", package], capture_output=True, text=True).stdout
    depends = re.search(r"^Depends: (.*)$", fields, re.M)[1]
    assert all(library in depends for library in ("libc6 (>=", "liblcm1", "libsodium23"))
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path / "tree"], check=True)
    for place in (
        "usr/bin/equipoise",
        "etc/equipoise/boards/robotics_cape_mbbr.toml",
        "lib/systemd/system/equipoise.service",
        "lib/udev/rules.d/90-equipoise.rules",
        "lib/firmware/equipoise-cape-1cell.dtbo",
        "lib/firmware/equipoise-blue-2cell.dtbo",
        "usr/lib/equipoise/choose-overlays",
        "usr/lib/modules-load.d/equipoise.conf",
    ):
        assert (tmp_path / "tree" / place).stat().st_size > 0
    return package, fields


@pytest.mark.slow
def test_the_package_is_whole_and_clean(root, tmp_path):
    package, _ = packed(root, tmp_path)
    ended = subprocess.run([tmp_path / "tree/usr/bin/equipoise", "--version"], capture_output=True, text=True)
    assert ended.stdout.strip() in package


@pytest.mark.cross
def test_the_robots_package_is_for_its_processor(root, tmp_path):
    package, fields = packed(root, tmp_path, "--preset", "bbb")
    assert package.endswith("_armhf.deb") and "\nArchitecture: armhf\n" in fields
    program = tmp_path / "tree/usr/bin/equipoise"
    header = subprocess.run(
        ["arm-linux-gnueabihf-readelf", "-h", "-A", program], capture_output=True, text=True
    ).stdout
    assert "hard-float ABI" in header and 'Tag_CPU_name: "8-A"' not in header
    assert re.search(r"Tag_CPU_arch: v7$", header, re.M), header
    emulator = ["qemu-arm", "-cpu", "cortex-a8", "-L", root / "build/sysroot"]
    ended = subprocess.run([*emulator, program, "--version"], capture_output=True, text=True)
    assert ended.stdout.strip() in package, ended.stderr


@pytest.mark.cross
def test_the_package_for_64_bit_boards_runs_there(root, tmp_path):
    package, fields = packed(root, tmp_path, "--preset", "arm64")
    assert package.endswith("_arm64.deb") and "\nArchitecture: arm64\n" in fields
    program = tmp_path / "tree/usr/bin/equipoise"
    emulator = ["qemu-aarch64", "-L", root / "build/sysroot-arm64"]
    ended = subprocess.run([*emulator, program, "--version"], capture_output=True, text=True)
    assert ended.stdout.strip() in package, ended.stderr


@pytest.mark.cross
def test_every_library_of_the_robots_package_comes_from_a_package_it_depends_on(root, tmp_path):
    _, fields = packed(root, tmp_path, "--preset", "bbb", "--no-lint")
    depends = set(
        re.findall(r"([a-z0-9.+-]+)(?: \([^)]*\))?(?:, |$)", re.search(r"^Depends: (.*)$", fields, re.M)[1])
    )
    dynamic = subprocess.run(
        ["arm-linux-gnueabihf-readelf", "-d", tmp_path / "tree/usr/bin/equipoise"],
        capture_output=True,
        text=True,
    ).stdout
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic)
    lists = root / "build/bbb/package/dpkg/info"
    for library in needed:
        owners = {
            f.name.split(".list")[0].split(":")[0]
            for f in lists.glob("*.list")
            if f"/{library}\n" in f.read_text()
        }
        assert owners & depends, f"{library} of {owners}, package depends on {depends}"
    assert len(needed) >= 5


def group_of(rules: str, device: dict[str, str], parents: list[str]) -> str | None:
    """By udev(7): matches with ==, KERNELS against the device or any parent; the last GROUP stays."""
    group = None
    for rule in rules.splitlines():
        words = re.findall(r'([A-Z]+)(==|\+=|=)"([^"]*)"', "" if rule.startswith("#") else rule)
        names = {"KERNELS": [device["KERNEL"], *parents], **{key: [value] for key, value in device.items()}}
        matches = [(names.get(key, []), value) for key, operator, value in words if operator == "=="]
        if words and all(any(fnmatch(name, value) for name in found) for found, value in matches):
            group = next(
                (value for key, operator, value in words if (key, operator) == ("GROUP", "=")), group
            )
    return group


# AM335x Technical Reference Manual, tables 2-2 and 2-3: I2C0 has the power controller and the board's EEPROM,
# I2C1 is free, I2C2 goes to the cape and, on the Blue, to the IMU.
@pytest.mark.parametrize(
    ("address", "group"), [("44e0b000", None), ("4802a000", None), ("4819c000", "equipoise")]
)
@pytest.mark.parametrize("number", [0, 1, 2])
def test_of_the_buses_only_the_imus_belongs_to_the_group(root, address, group, number):
    """The kernel numbers buses as it finds them: the address names the bus, the number does not."""
    rules = (root / "packaging/90-equipoise.rules").read_text()
    bus = {"SUBSYSTEM": "i2c-dev", "KERNEL": f"i2c-{number}"}
    parents = [f"i2c-{number}", f"{address}.i2c", f"{address}.target-module", "ocp"]
    assert group_of(rules, bus, parents) == group
