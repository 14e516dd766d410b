"""A request counts when somebody makes it: what a stall has delayed does not arm a robot, and a blocked
terminal does not hold up a disarm."""

import json
import os
import signal
import subprocess
import time

import pytest
from equipoise_tools.cockpit.robot import private_url
from started_cockpit import PATIENCE_S

pytestmark = pytest.mark.live


class Robot:
    """A simulated robot that takes commands; `stderr` as Popen takes it. SIGHUP as a terminal leaves it: what
    runs these tests may ignore it (nohup)."""

    def __init__(self, root, folder, stderr=subprocess.DEVNULL, hangup=signal.SIG_DFL):
        self.binary, self.url, self.key = root / "build/host/equipoise", private_url(), folder / "robot.key"
        self.json = folder / "run.json"
        subprocess.run([self.binary, "keygen", self.key], check=True, stdout=subprocess.DEVNULL)
        command = [self.binary, "run", "--config", root / "config/edumip.toml", "--backend", "sim"]
        command += ["--fidelity", "nominal", "--telemetry", "off", "--log", "off", "--json", self.json]
        command += ["--command-url", self.url, "--command-key", self.key]
        before = signal.signal(signal.SIGHUP, hangup)
        try:
            self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr)
        finally:
            signal.signal(signal.SIGHUP, before)

    def send(self, *arguments):
        return [self.binary, "send", "--key", self.key, "--url", self.url, *map(str, arguments)]

    def told(self, *arguments):
        return subprocess.run(self.send(*arguments), capture_output=True, text=True, timeout=PATIENCE_S)

    def end(self, number=signal.SIGINT) -> dict:
        self.process.send_signal(number)
        self.process.wait(PATIENCE_S)
        return json.loads(self.json.read_text())


@pytest.fixture
def robot(root, tmp_path, multicast):
    made = Robot(root, tmp_path)
    yield made
    made.process.kill()
    made.process.wait()


def test_an_arm_that_send_live_was_stopped_over_is_void(robot):
    send = robot.send("--timeout-s", PATIENCE_S, "--live")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(send, **pipes, text=True) as live:
        assert json.loads(live.stdout.readline())["state"] == "off"
        live.send_signal(signal.SIGSTOP)
        live.stdin.write("arm\n")
        live.stdin.flush()
        time.sleep(1.6)  # longer than a request lives
        live.send_signal(signal.SIGCONT)
        assert "what was asked before is void" in live.stderr.readline()
        live.stdin.write("disarm\n")  # begins the first turn, if there was none
        live.stdin.close()
        turns = [json.loads(line)["turn"] for line in live.stdout]
    assert turns[-1] == 1
    assert not robot.end()["armed"]


SUSPENDED = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t clock, struct timespec* t) {
  int (*real)(clockid_t, struct timespec*);
  *(void**)&real = dlsym(RTLD_NEXT, "clock_gettime");
  const int status = real(clock, t);
  if (clock == CLOCK_BOOTTIME && access(getenv("SUSPENDED"), F_OK) == 0) t->tv_sec += 100;
  return status;
}
"""


def test_an_arm_that_the_machine_was_suspended_over_is_void(robot, tmp_path):
    """A suspended machine's monotonic clock stands still: only that of its start shows it."""
    library, suspended = tmp_path / "suspended.so", tmp_path / "suspended"
    command = [os.environ.get("CC", "cc"), "-shared", "-fPIC", "-x", "c", "-", "-o", library]
    subprocess.run(command, input=SUSPENDED, text=True, check=True)
    send = robot.send("--timeout-s", PATIENCE_S, "--live")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    asleep = os.environ | {"LD_PRELOAD": str(library), "SUSPENDED": str(suspended)}
    with subprocess.Popen(send, **pipes, text=True, env=asleep) as live:
        assert json.loads(live.stdout.readline())["state"] == "off"
        live.send_signal(signal.SIGSTOP)
        live.stdin.write("arm\n")
        live.stdin.close()
        suspended.touch()
        live.send_signal(signal.SIGCONT)
        assert "was stopped for 100" in live.stderr.read()
    assert not robot.end()["armed"]


def test_an_arm_that_was_stopped_at_its_start_is_void(robot):
    robot.told("--disarm")  # it is there
    with subprocess.Popen(robot.send("--arm"), stderr=subprocess.PIPE, text=True) as late:
        late.send_signal(signal.SIGSTOP)
        time.sleep(4.0)
        late.send_signal(signal.SIGCONT)
        assert "it would come too late" in late.stderr.read()
    assert late.returncode == 1
    assert not robot.end()["armed"]


def test_a_disarm_is_never_too_late(robot):
    robot.told("--timeout-s", PATIENCE_S, "--arm")
    with subprocess.Popen(robot.send("--disarm"), stdout=subprocess.PIPE, text=True) as late:
        late.send_signal(signal.SIGSTOP)
        time.sleep(3.0)
        late.send_signal(signal.SIGCONT)
        assert late.stdout.read() == "disarmed\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_robot_whose_stderr_nobody_reads_hears_a_disarm_and_ends(root, tmp_path, multicast, number):
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with pytest.raises(BlockingIOError):
        while True:
            os.write(writing, bytes(4096))
    os.set_blocking(writing, True)
    robot = Robot(root, tmp_path, stderr=writing)
    try:
        armed = robot.told("--timeout-s", PATIENCE_S, "--arm")
        assert armed.stdout == "armed\n", armed.stderr
        disarmed = robot.told("--timeout-s", PATIENCE_S, "--disarm")
        assert disarmed.stdout == "disarmed\n", disarmed.stderr
        assert robot.end(number)["ended"] == "interrupted"
    finally:
        robot.process.kill()
        robot.process.wait()
        os.close(reading)
        os.close(writing)


def test_under_nohup_a_robot_goes_on_when_its_terminal_closes(root, tmp_path, multicast):
    robot = Robot(root, tmp_path, hangup=signal.SIG_IGN)
    try:
        assert robot.told("--timeout-s", PATIENCE_S, "--arm").stdout == "armed\n"
        robot.process.send_signal(signal.SIGHUP)
        assert robot.told("--timeout-s", PATIENCE_S, "--disarm").stdout == "disarmed\n"
        assert robot.end()["ended"] == "interrupted"
    finally:
        robot.process.kill()
        robot.process.wait()


def test_a_terminal_that_is_stopped_does_not_hold_up_a_disarm(root, tmp_path, multicast):
    ours, theirs = os.openpty()
    os.write(ours, b"\x13")  # Ctrl-S
    robot = Robot(root, tmp_path, stderr=theirs)
    try:
        assert robot.told("--timeout-s", PATIENCE_S, "--arm").stdout == "armed\n"
        assert robot.told("--timeout-s", PATIENCE_S, "--disarm").stdout == "disarmed\n"
        assert robot.end()["ended"] == "interrupted"
    finally:
        robot.process.kill()
        robot.process.wait()


def test_who_commands_is_said_where_somebody_reads(root, tmp_path, multicast):
    robot = Robot(root, tmp_path, stderr=subprocess.PIPE)
    try:
        assert robot.told("--timeout-s", PATIENCE_S, "--arm").stdout == "armed\n"
        robot.end()
        assert b"equipoise: owner asks for the motors\n" in robot.process.stderr.read()
    finally:
        robot.process.kill()
        robot.process.wait()


def test_a_name_that_no_sender_can_say_is_refused(root, tmp_path):
    for name in ("a b", "seventeen-letters", "gr\u00fcn"):
        command = [root / "build/host/equipoise", "run", "--config", root / "config/edumip.toml"]
        command += ["--backend", "sim", "--robot-name", name, "--log", "off", "--duration-s", "1"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert done.returncode == 2 and "--robot-name" in done.stderr


def test_what_is_scripted_and_what_is_commanded_exclude_each_other(root, robot):
    for option in (["--path", "circle"], ["--drive-mps", "0.1"], ["--yaw-hz", "0.5"]):
        command = [root / "build/host/equipoise", "run", "--config", root / "config/edumip.toml"]
        command += ["--backend", "sim", "--command-key", robot.key, *option]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        assert done.returncode == 2 and "excludes" in done.stderr, done.stderr
