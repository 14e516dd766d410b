"""A /sys, /proc and /dev as the MBBR's board has them, and what `equipoise doctor` finds there."""

import json
import os
import subprocess
from pathlib import Path

GPIO = {"44e07000": 0, "4804c000": 1, "481ac000": 2, "481ae000": 3}
# Pads of the MBBR's pins, and what they must be switched to: AM335x data sheet, BeagleBone Black headers.
PADS = {
    0x978: 0x33,
    0x97C: 0x33,
    0x980: 0x30,
    0x984: 0x10,  # I2C2, UART1
    0x848: 0x06,
    0x84C: 0x06,
    0x820: 0x04,  # EHRPWM1A, 1B, 2A
    0x9A0: 0x31,
    0x9A4: 0x31,
    0x8D0: 0x32,
    0x8D4: 0x32,
    0x830: 0x34,
    0x834: 0x34,  # eQEP0, 1, 2
    **dict.fromkeys((0x9B4, 0x878, 0x874, 0x840, 0x8CC, 0x8AC, 0x8A8), 0x07),  # enable, in1, in2
    **dict.fromkeys((0x890, 0x894, 0x82C, 0x88C, 0x87C, 0x828), 0x07),  # LEDs
    **dict.fromkeys((0x9AC, 0x844, 0x99C, 0x998, 0x89C, 0x898), 0x37),  # interrupt, faults, buttons
}


# Who claims them: the devices, and the pin controller what are plain lines.
OWNERS = {
    **dict.fromkeys(PADS, "44e10800.pinmux"),
    **dict.fromkeys((0x980, 0x984), "48022000.serial"),
    **dict.fromkeys((0x978, 0x97C), "4819c000.i2c"),
    **dict.fromkeys((0x848, 0x84C), "48302200.pwm"),
    0x820: "48304200.pwm",
    **dict.fromkeys((0x9A0, 0x9A4), "48300180.counter"),
    **dict.fromkeys((0x8D0, 0x8D4), "48302180.counter"),
    **dict.fromkeys((0x830, 0x834), "48304180.counter"),
}


def write(path: Path, text: str = "") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def device(root: Path, bus: str, path: str, attributes: dict[str, str]) -> None:
    """A device and its link in /sys/BUS."""
    place = root / "sys/devices/platform/ocp" / path
    for name, value in attributes.items():
        write(place / name, value)
    link = root / "sys" / bus / place.name
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(os.path.relpath(place, link.parent))


def thread(root: Path, number: int, name: str, priority: int) -> None:
    write(root / f"proc/{number}/comm", f"{name}\n")
    write(root / f"proc/{number}/stat", f"{number} ({name}) S " + "0 " * 35 + f"1 {priority} 1 0\n")


def owners(root: Path, names: dict[int, str]) -> None:
    lines = [
        f"pin {(at - 0x800) // 4} (PIN{(at - 0x800) // 4}): {name} (GPIO UNCLAIMED) function a group b\n"
        for at, name in names.items()
    ]
    lines.append("pin 141 (PIN141): (MUX UNCLAIMED) (GPIO UNCLAIMED)\n")
    write(root / "sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/pinmux-pins", "".join(lines))


def pads(root: Path, values: dict[int, int]) -> None:
    lines = [
        f"pin {(at - 0x800) // 4} (PIN{at}) 0:? {0x44E10000 + at:08x} {value:08x} pinctrl-single \n"
        for at, value in values.items()
    ]
    write(
        root / "sys/kernel/debug/pinctrl/44e10800.pinmux-pinctrl-single/pins", "registered\n" + "".join(lines)
    )


def made_up(root: Path) -> Path:
    """Everything but the IMU, which answers only to ioctls: see tests/drivers/doctor_test.cpp."""
    write(root / "proc/version", "Linux version 6.1.46-bone-rt-r14 #1 PREEMPT_RT\n")
    write(root / "sys/kernel/realtime", "1\n")
    write(root / "proc/device-tree/model", "TI AM335x BeagleBone Black\0")
    write(root / "proc/device-tree/chosen/overlays/equipoise-cape.kernel", "pinctrl-cells 1\0")
    write(root / "proc/device-tree/ocp/scm@0/pinmux@800/#pinctrl-cells", "\0\0\0\1")
    for name in ("", "-1cell"):
        write(root / f"lib/firmware/equipoise-cape{name}.dtbo", "one")
    write(root / "lib/firmware/equipoise-cape-2cell.dtbo", "two")
    write(
        root / "boot/uEnv.txt",
        "disable_uboot_overlay_video=1\ndisable_uboot_overlay_audio=1\n#enable_uboot_cape_universal=1\n",
    )
    for name, value in (("state", "active"), ("identity", "OMAP Watchdog"), ("timeout", "5")):
        write(root / f"sys/class/watchdog/watchdog0/{name}", f"{value}\n")
    for number, name, priority in (
        (50, "irq/45-4819c000", 70),
        (51, "irq/44-481ae000", 70),
        (52, "irq/60-4a100000", 50),
    ):
        thread(root, number, name, priority)
    device(root, "class/tty", "48022000.serial/tty/ttyO1", {"dev": "251:1"})
    device(root, "class/tty", "481aa000.serial/tty/ttyO5", {"dev": "251:5"})
    write(root / "sys/devices/system/clocksource/clocksource0/current_clocksource", "dmtimer\n")
    limits = "Max realtime priority     {0}                   {0}\n"
    write(
        root / "proc/self/limits",
        limits.format(99) + "Max locked memory         unlimited  unlimited  bytes\n",
    )
    write(root / "proc/self/status", "CapEff:\t0000000000000000\n")
    write(
        root / "proc/net/route",
        "Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT\n"
        "lo 000000E0 00000000 0001 0 0 0 000000F0 0 0 0\n",
    )
    for address, number in (("48302200", 4), ("48304200", 7)):
        device(root, "class/pwm", f"{address}.pwm/pwm/pwmchip{number}", {"npwm": "2\n", "export": ""})
    for number, address in enumerate(("48300180", "48302180", "48304180")):
        device(root, "bus/counter/devices", f"{address}.counter/counter{number}", {"count0/enable": "0\n"})
    adc = {"name": "TI-am335x-adc.0.auto\n", "in_voltage6_raw": "1655\n"}
    device(root, "bus/iio/devices", "44e0d000.adc/iio:device0", adc)
    for address, number in GPIO.items():
        device(root, "bus/gpio/devices", f"{address}.gpio/gpiochip{number}", {"label": address})
        write(root / f"dev/gpiochip{number}")
    for name in ("cpu_dma_latency", "ttyO1", "ttyO5"):
        write(root / "dev" / name)
    pads(root, PADS)
    owners(root, OWNERS)
    return root


def examine(root: Path, robot: Path, *arguments, board="robotics_cape_mbbr"):
    command = [root / "build/host/equipoise", "doctor", "--json", "-", "--root", robot]
    if board:
        command += ["--board", board if isinstance(board, Path) else root / f"config/boards/{board}.toml"]
    ended = subprocess.run([*command, *arguments], capture_output=True, text=True, timeout=30)
    result = json.loads(ended.stdout)
    assert ended.returncode == (0 if result["ok"] else 1)
    return {check["name"]: check for check in result["checks"]}, ended.stderr
