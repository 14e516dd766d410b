"""run --remote and remote: a pipe in the place of a gamepad, a pseudo-terminal in that of an HC-06."""

import contextlib
import json
import os
import signal
import struct
import subprocess
import termios
import threading
import time
from fcntl import ioctl

import numpy as np
import pytest
from equipoise_robot.log import read_log

pytestmark = pytest.mark.live

EV_KEY, EV_ABS, ABS_Y, BTN_START, BTN_EAST = 1, 3, 1, 0x13B, 0x131
DEADLINE_S = 60.0  # for a broken program, not for a slow machine
GAMEPAD = """
[remote]
kind = "events"
device = "{device}"
speed_m_s = 0.1
turn_hz = 0.25
hold_s = 10.0
[events]
axis_range = [0, 255]
arm = "BTN_START"
disarm = "BTN_EAST"
forward = "-ABS_Y"
"""
APP = """
[remote]
kind = "frames"
device = "{device}"
baud = 9600
speed_m_s = 0.1
turn_hz = 0.25
hold_s = 0.5
[frames]
arm = "7e41"
disarm = "7e61"
forward = "7e46"
"""


class Gamepad:
    def __init__(self, folder):
        self.path = folder / "event0"
        os.mkfifo(self.path)
        self.fd = os.open(self.path, os.O_RDWR)
        self.config = folder / "gamepad.toml"
        self.config.write_text(GAMEPAD.format(device=self.path))
        self.put(EV_ABS, ABS_Y, 128)

    def put(self, kind, code, value):
        os.write(self.fd, struct.pack("@llHHi", 0, 0, kind, code, value))

    def arm(self):
        self.put(EV_KEY, BTN_START, 1)
        self.put(EV_KEY, BTN_START, 0)

    def forward(self):
        self.put(EV_ABS, ABS_Y, 0)

    def lose(self):
        if self.fd is not None:
            os.close(self.fd)
        self.fd = None


class App:
    """A phone: what is held sends its frame again and again."""

    def __init__(self, folder):
        self.fd, self.slave = os.openpty()
        self.config = folder / "app.toml"
        self.config.write_text(APP.format(device=os.ttyname(self.slave)))
        self.held, self.stop = None, threading.Event()
        threading.Thread(target=self.keep, daemon=True).start()

    def arm(self):
        self.held = b"~A"

    def forward(self):
        self.held = b"~F"

    def keep(self):
        while not self.stop.wait(0.05):
            if self.held:
                os.write(self.fd, self.held)

    def lose(self):
        self.held = None


class RemoteRun:
    """A robot in the simulated world, and what its log says while it runs."""

    def __init__(self, root, folder, remote):
        self.log, self.json, self.remote = folder / "run.lcm", folder / "run.json", remote
        command = [root / "build/host/equipoise", "run", "--config", "config/mbbr.toml", "--backend", "sim"]
        command += ["--fidelity", "nominal", "--telemetry", "off", "--log", self.log, "--json", self.json]
        self.process = subprocess.Popen(
            [*command, "--remote", remote.config], cwd=root, stderr=subprocess.PIPE, text=True
        )

    def wait(self, wanted):
        end = time.monotonic() + DEADLINE_S
        while time.monotonic() < end:
            time.sleep(0.05)
            with contextlib.suppress(KeyError, IndexError, FileNotFoundError, ValueError):
                if wanted(read_log(self.log)):
                    return True
            assert self.process.poll() is None, self.process.communicate()[1]
        return False

    def end(self):
        self.process.send_signal(signal.SIGINT)
        _, said = self.process.communicate(timeout=DEADLINE_S)
        return read_log(self.log), json.loads(self.json.read_text()), said


def newest(log, channel, field):
    return log[f"EQUIPOISE_{channel}"][field][-1]


def reference_speed(log):
    return np.hypot(*np.diff(log["EQUIPOISE_REFERENCE"]["position_W_m"][-2:], axis=0)[0]) * 200.0


@pytest.mark.parametrize("kind", [Gamepad, App])
def test_its_loss_ramps_to_a_stop_and_the_robot_stays_up(root, tmp_path, kind):
    remote = kind(tmp_path)
    run = RemoteRun(root, tmp_path, remote)
    try:
        assert run.wait(lambda log: len(log["EQUIPOISE_MOTORS"]["enable"]) > 200)
        assert not newest(read_log(run.log), "MOTORS", "enable"), "nobody has armed it"
        remote.arm()
        assert run.wait(lambda log: newest(log, "MOTORS", "enable"))
        remote.lose() if kind is App else None  # the button is let go of before another is pressed
        assert run.wait(lambda log: np.allclose(newest(log, "COMMAND", "velocity_W_m_s"), 0.0))
        remote.forward()
        assert run.wait(lambda log: reference_speed(log) > 0.09)
        remote.lose()
        assert run.wait(lambda log: reference_speed(log) < 1e-3)
    finally:
        log, said, journal = run.end()
        remote.lose()
    assert "the remote asks for the motors" in journal
    assert said["ended"] == "interrupted" and not said["fell"]
    enabled = np.asarray(log["EQUIPOISE_MOTORS"]["enable"])
    assert enabled[np.argmax(enabled) :].all(), "a loss turns no motor off"
    position_m = np.asarray(log["EQUIPOISE_REFERENCE"]["position_W_m"])[:, 0]
    change_m_s2 = np.abs(np.diff(position_m, 2)) * 200.0**2
    assert change_m_s2.max() < 0.6, "a ramp, no step (reference.max_acceleration_m_s2 is 0.5)"


def test_a_remote_and_a_key_are_one_too_many(root, tmp_path):
    remote = Gamepad(tmp_path)
    command = [root / "build/host/equipoise", "run", "--config", "config/mbbr.toml", "--backend", "sim"]
    done = subprocess.run(
        [*command, "--remote", remote.config, "--command-key", remote.config],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2 and "--command-key" in done.stderr
    remote.config.write_text(GAMEPAD.format(device=tmp_path / "nothing"))
    done = subprocess.run(
        [*command, "--remote", remote.config], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "nothing: No such file" in done.stderr


def test_lines_are_those_of_send_live(root, tmp_path):
    remote = Gamepad(tmp_path)
    lines = subprocess.Popen(
        [root / "build/host/equipoise", "remote", "lines", remote.config], stdout=subprocess.PIPE, text=True
    )
    remote.arm()
    assert lines.stdout.readline() == "arm\n"
    remote.forward()
    assert lines.stdout.readline() == "drive 0.1 0 0\n"
    assert lines.stdout.readline() == "drive 0.1 0 0\n", "again and again: each is a command of half a second"
    remote.put(EV_ABS, ABS_Y, 128)
    while (line := lines.stdout.readline()) == "drive 0.1 0 0\n":
        pass
    assert line == "drive 0 0 0\n"
    remote.put(EV_KEY, BTN_EAST, 1)
    assert lines.stdout.readline() == "disarm\n"
    lines.send_signal(signal.SIGTERM)
    assert lines.wait(DEADLINE_S) == 0
    remote.lose()


def taught(root, folder, buttons):
    """What remote learn makes of an app; `buttons`: what each sends, piece by piece."""
    master, slave = os.openpty()
    out = folder / "learnt.toml"
    command = [root / "build/host/equipoise", "remote", "learn", "--port", os.ttyname(slave), "--out", out]
    learn = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    said = ""
    for line in learn.stderr:
        said += line
        if not line.startswith("Hold the button for "):
            continue
        pieces = buttons.get(line.split(" for ")[1])
        if not pieces:
            learn.stdin.write("\n")
            learn.stdin.flush()
        for piece in pieces or []:
            os.write(master, piece)
            while struct.unpack("@i", ioctl(slave, termios.FIONREAD, b"1234"))[0] > 0:
                time.sleep(0.005)  # until it is read; only then the pause that ends a burst begins
            time.sleep(0.15)
    status = learn.wait(DEADLINE_S)
    os.close(master)
    os.close(slave)
    return status, said, out


def test_learn_writes_what_run_reads(root, tmp_path):
    buttons = {"arm": [b"A"] * 4, "disarm": [b"a"], "forward": [b"~F\n"] * 5 + [b"0"]}
    buttons |= {"turn_left": [b"~L\n", b"0"]}
    status, said, out = taught(root, tmp_path, buttons)
    assert status == 0, said
    frames = dict(
        line.split(" = ") for line in out.read_text().split("[frames]")[1].splitlines() if "=" in line
    )
    assert frames == {
        "arm": '"41"',
        "disarm": '"61"',
        "forward": '"7e460a"',
        "turn_left": '"7e4c0a"',
        "stop": '"30"',
    }
    done = subprocess.run(
        [root / "build/host/equipoise", "remote", "lines", out], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "serial: /dev/pts" in done.stderr  # read well; the terminal is gone


def test_learn_refuses_what_cannot_be_told_apart(root, tmp_path):
    status, said, out = taught(root, tmp_path, {"arm": [b"A"], "disarm": [b"A"]})
    assert status == 1 and "41 is disarm and arm" in said and not out.exists()
    status, said, out = taught(root, tmp_path, {"arm": [b"A"], "forward": [b"F"]})
    assert status != 0 and "needs arm and disarm" in said and not out.exists()


@pytest.mark.slow
def test_learn_does_not_listen_for_ever_to_bytes_without_a_pause(root, tmp_path):
    """An app that sends by itself, or a wrong baud rate: nothing is learnt and the user is told."""
    master, slave = os.openpty()
    os.set_blocking(master, False)
    out, stop = tmp_path / "learnt.toml", threading.Event()

    def feed():
        while not stop.wait(0.02):
            with contextlib.suppress(BlockingIOError):
                os.write(master, b"x")

    command = [root / "build/host/equipoise", "remote", "learn", "--port", os.ttyname(slave), "--out", out]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as learn:
        feeder = threading.Thread(target=feed)
        feeder.start()
        try:
            said = learn.communicate(timeout=DEADLINE_S)[1]
        finally:
            learn.kill()
            stop.set()
            feeder.join()
    assert learn.returncode == 1 and "without a pause" in said and not out.exists()
    os.close(master)
    os.close(slave)


def test_what_was_pressed_while_lines_was_stopped_is_void_but_for_a_disarm(root, tmp_path):
    gamepad = Gamepad(tmp_path)
    command = [root / "build/host/equipoise", "remote", "lines", gamepad.config]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as lines:
        gamepad.arm()
        assert lines.stdout.readline() == "arm\n"
        lines.send_signal(signal.SIGSTOP)
        gamepad.arm()
        time.sleep(1.5)
        lines.send_signal(signal.SIGCONT)
        time.sleep(0.5)
        gamepad.put(EV_KEY, BTN_EAST, 1)
        assert lines.stdout.readline() == "disarm\n"
        lines.terminate()
