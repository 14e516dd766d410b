"""equipoise doctor on a made-up /sys, /proc and /dev: what it finds, and what it says to do."""

import re
import subprocess
from pathlib import Path

import pytest
from made_up_machine import OWNERS, PADS, device, examine, made_up, owners, pads, thread, write


def failing(checks) -> dict:
    return {name: check for name, check in checks.items() if check["verdict"] == "fail"}


@pytest.fixture
def robot(tmp_path) -> Path:
    return made_up(tmp_path / "robot")


def test_a_robot_whose_imu_is_missing_fails_in_that_alone(root, robot):
    checks, text = examine(root, robot)
    assert list(failing(checks)) == ["imu.bus"]
    assert "/dev/i2c-2" in checks["imu.bus"]["what"] and "modprobe i2c-dev" in checks["imu.bus"]["fix"]
    assert checks["battery.adc"]["what"].startswith("7.90 V")  # 1655 * 1.8 / 4095 * 11 - 0.10
    assert checks["lcm.route"]["what"].endswith("through lo")
    assert checks["can"]["verdict"] == "skipped"
    assert len([name for name in checks if name.startswith("pinmux.")]) == len(PADS)
    assert "1 failures" in text


BREAKS = {  # what breaks it: (check, verdict, in what is wrong, in the fix)
    "sys/kernel/realtime": ("kernel.preempt_rt", "warn", "not PREEMPT_RT", "bone-rt"),
    "sys/class/pwm/pwmchip7": ("pwm.3", "fail", "no EHRPWM at 48304200", "uboot_overlay_addr4"),
    "sys/bus/counter/devices/counter1": ("encoder.2", "fail", "no eQEP at 48302180", "uboot_overlay_addr4"),
    "sys/bus/iio/devices/iio:device0": ("battery.adc", "fail", "no ADC", "equipoise-cape.dtbo"),
    "sys/bus/gpio/devices/gpiochip3": ("gpio.481ae000.21", "fail", "[imu] interrupt", "gpiodetect"),
    "dev/ttyO1": ("serial", "warn", "/dev/ttyO1: No such file", "reboot"),
    "sys/class/tty/ttyO1": ("serial", "warn", "no UART at 48022000", "uboot_overlay_addr4"),
    "sys/class/watchdog/watchdog0/state": (
        "kernel.watchdog",
        "warn",
        "no hardware watchdog",
        "modprobe omap_wdt",
    ),
    "proc/net/route": ("lcm.route", "warn", "no route to 239.255.76.67", "ip route add 224.0.0.0/4 dev lo"),
    "dev/cpu_dma_latency": ("limits.cpu_idle", "warn", "deep idle", "adduser"),
    "proc/device-tree/chosen/overlays/equipoise-cape.kernel": (
        *("device_tree.overlay", "warn"),
        *("not loaded", "uboot_overlay_addr4"),
    ),
}


@pytest.mark.parametrize("broken", BREAKS)
def test_what_is_missing_is_named_with_its_fix(root, robot, broken):
    (robot / broken).unlink()
    if broken == "sys/kernel/realtime":
        write(robot / "proc/version", "Linux version 6.1.46-bone SMP PREEMPT\n")
    name, verdict, what, fix = BREAKS[broken]
    checks, _ = examine(root, robot)
    assert checks[name]["verdict"] == verdict
    assert what in checks[name]["what"] and fix in checks[name]["fix"]


def test_limits_of_an_ordinary_user_fail_on_a_robot_and_warn_elsewhere(root, robot):
    write(robot / "proc/self/limits", "Max realtime priority 0 0\nMax locked memory 65536 65536 bytes\n")
    checks, _ = examine(root, robot)
    assert {"limits.rtprio", "limits.memlock"} <= set(failing(checks))
    assert "@equipoise - rtprio 99" in checks["limits.rtprio"]["fix"]
    checks, _ = examine(root, robot, board=None)
    assert checks["limits.rtprio"]["verdict"] == checks["limits.memlock"]["verdict"] == "warn"
    write(robot / "proc/self/status", "CapEff:\t0000000000804000\n")  # CAP_SYS_NICE, CAP_IPC_LOCK
    checks, _ = examine(root, robot)
    assert checks["limits.rtprio"]["verdict"] == checks["limits.memlock"]["verdict"] == "ok"


@pytest.mark.parametrize(
    "pad, value, pin, what",
    [
        (0x848, 0x07, "P9.14", "motor 1 pwm: pad is in mode 7, needs mode 6"),
        (0x8D4, 0x12, "P8.33", "motor 2 encoder: the pad's receiver is off"),
        (0x9AC, 0x31, "P9.25", "[imu] interrupt: pad is in mode 1, needs mode 7"),
    ],
)
def test_a_pin_that_is_switched_to_another_function_is_named(root, robot, pad, value, pin, what):
    pads(robot, {**PADS, pad: value})
    checks, _ = examine(root, robot)
    assert sorted(failing(checks)) == ["imu.bus", f"pinmux.{pin}"]
    assert what in checks[f"pinmux.{pin}"]["what"]


def test_without_debugfs_the_pins_are_not_guessed(root, robot):
    pads(robot, {})
    checks, _ = examine(root, robot)
    assert checks["pinmux"]["verdict"] == "skipped" and "sudo" in checks["pinmux"]["fix"]


def with_can(root, tmp_path, device) -> Path:
    text = (root / "config/boards/robotics_cape_mbbr.toml").read_text()
    text = re.sub(r'interface = ""', 'interface = "481d0000"', text)
    text = text.replace('device = "48022000"', f'device = "{device}"')
    write(tmp_path / "can.toml", text)
    return tmp_path / "can.toml"


def test_can_needs_its_overlay_its_pins_and_a_bit_rate(root, robot, tmp_path):
    checks, _ = examine(root, robot, board=with_can(root, tmp_path, "48022000"))
    assert "share P9.24" in checks["can"]["what"] and "481aa000" in checks["can"]["fix"]
    board = with_can(root, tmp_path, "481aa000")
    checks, _ = examine(root, robot, board=board)
    assert checks["can"]["verdict"] == "fail" and "equipoise-can.dtbo" in checks["can"]["fix"]
    assert checks["serial"]["what"] == "481aa000: /dev/ttyO5 opens"
    device(robot, "class/net", "481d0000.can/net/can0", {"operstate": "down\n"})  # alone it is the first
    checks, _ = examine(root, robot, board=board)
    assert checks["can"]["fix"] == "sudo ip link set can0 up type can bitrate 500000 restart-ms 100"
    write(robot / "sys/class/net/can0/operstate", "up\n")
    checks, _ = examine(root, robot, board=board)
    assert checks["can"]["verdict"] == "ok"


@pytest.mark.parametrize(
    ("line", "replacement", "check"),
    [
        ("disable_uboot_overlay_video=1", "#disable_uboot_overlay_video=1", "uenv.video"),
        ("disable_uboot_overlay_audio=1\n", "", "uenv.audio"),
        ("#enable_uboot_cape_universal=1", "enable_uboot_cape_universal=1", "uenv.cape_universal"),
    ],
)
def test_the_boot_loaders_file_must_leave_the_pads_to_us(root, robot, line, replacement, check):
    file = robot / "boot/uEnv.txt"
    assert examine(root, robot)[0][check]["verdict"] == "ok"
    file.write_text(file.read_text().replace(line, replacement))
    found = examine(root, robot)[0][check]
    assert found["verdict"] == "fail"
    # The command does what it says, on this file.
    command = (
        found["fix"].removesuffix(" && sudo reboot").replace("sudo ", "").replace("/boot/uEnv.txt", str(file))
    )
    subprocess.run(["sh", "-c", command], check=True, capture_output=True)
    assert examine(root, robot)[0][check]["verdict"] == "ok"


def test_an_overlay_for_the_other_kind_of_pin_controller_is_found(root, robot):
    assert examine(root, robot)[0]["device_tree.twin"]["verdict"] == "ok"
    write(robot / "proc/device-tree/ocp/scm@0/pinmux@800/#pinctrl-cells", "\0\0\0\2")  # another kernel
    checks, _ = examine(root, robot)
    assert {"device_tree.cells", "device_tree.twin"} <= set(failing(checks))
    assert "#pinctrl-cells = <2>" in checks["device_tree.cells"]["what"]
    assert "choose-overlays" in checks["device_tree.twin"]["fix"]


def test_a_pad_that_belongs_to_somebody_else_is_found(root, robot):
    owners(robot, {**OWNERS, 0x8AC: "tda998x", 0x848: "hog"})
    checks, _ = examine(root, robot)
    assert checks["owner.P8.44"]["what"] == "motor 3 in1: its pad belongs to tda998x"
    assert checks["owner.P9.14"]["verdict"] == "fail"
    owners(robot, {at: name for at, name in OWNERS.items() if at != 0x9AC})
    assert "no driver has claimed" in examine(root, robot)[0]["owner.P9.25"]["what"]


def test_interrupts_of_the_sample_come_first(root, robot):
    found = examine(root, robot)[0]["kernel.irq_threads"]
    assert found["verdict"] == "ok" and "GPIO at 70, Ethernet and MMC at 50" in found["what"]
    thread(robot, 51, "irq/44-481ae000.gpio", 50)
    found = examine(root, robot)[0]["kernel.irq_threads"]
    assert found["verdict"] == "warn" and "481ae000" in found["what"] and "real-time-machine" in found["fix"]


def test_a_watchdog_that_nobody_started_is_found(root, robot):
    write(robot / "sys/class/watchdog/watchdog0/state", "inactive\n")
    found = examine(root, robot)[0]["kernel.watchdog"]
    assert found["verdict"] == "warn" and "RuntimeWatchdogSec=5" in found["fix"]


def test_the_governor_has_a_fix(root, robot):
    write(robot / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "schedutil\n")
    assert examine(root, robot)[0]["kernel.cpu_frequency"]["verdict"] == "warn"


def test_the_report_holds_what_a_helper_needs_and_no_key(root, robot, tmp_path):
    key = tmp_path / "key"
    subprocess.run([root / "build/host/equipoise", "keygen", key], check=True, capture_output=True)
    examine(root, robot, "--command-key", key, "--report", tmp_path / "report.txt")
    text = (tmp_path / "report.txt").read_text()
    for piece in (
        "fail imu.bus: /dev/i2c-2",
        "Linux version 6.1.46-bone-rt-r14",
        "disable_uboot_overlay_video=1",
        "48302200.pwm (GPIO UNCLAIMED)",
        "(irq/45-4819c000) S",
        'robot = "mbbr"',
        "equipoise-cape.kernel",
    ):
        assert piece in text, piece
    assert key.read_text().split()[-1] not in text
    command = [root / "build/host/equipoise", "doctor", "--report", tmp_path / "none/report.txt"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 2 and "cannot be written" in ended.stderr


def test_a_key_that_others_can_read_fails(root, robot, tmp_path):
    key = tmp_path / "key"
    subprocess.run([root / "build/host/equipoise", "keygen", key], check=True, capture_output=True)
    checks, _ = examine(root, robot, "--command-key", key)
    assert checks["command.key"]["verdict"] == "ok"
    key.chmod(0o640)
    checks, _ = examine(root, robot, "--command-key", key)
    assert checks["command.key"]["verdict"] == "fail" and checks["command.key"]["fix"] == f"chmod 600 {key}"


def test_a_laptop_gets_an_answer_not_a_crash(root, tmp_path):
    """An empty machine: nothing is there, nothing but the robot is missing."""
    checks, _ = examine(root, tmp_path, board=None)
    assert not failing(checks)
    assert checks["device_tree.model"]["what"] == "no device tree: a machine for simulation, not a robot"
    checks, _ = examine(root, tmp_path)
    assert not failing(checks)
    assert "without an error" in checks["board"]["what"] and "on the robot" in checks["board"]["fix"]
    write(tmp_path / "proc/device-tree/model", "Another Board\0")
    assert "device_tree.model" in failing(examine(root, tmp_path)[0])


def test_every_finding_that_is_not_fine_says_what_to_do(root, tmp_path, robot):
    for place in (tmp_path, robot):
        for check in examine(root, place)[0].values():
            if check["verdict"] in ("warn", "fail"):
                assert check["fix"], check


def test_bad_usage_is_one_clear_line(root, tmp_path):
    command = [root / "build/host/equipoise", "doctor"]
    for arguments in (["--root", tmp_path / "none"], ["--board", tmp_path / "none.toml"]):
        ended = subprocess.run([*command, *arguments], capture_output=True, text=True)
        assert ended.returncode == 2 and ended.stderr.count("\n") == 1 and "none" in ended.stderr
