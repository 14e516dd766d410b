"""Plays the attacks on one kind of wire and prints what came of each, as JSON: attack -> expectation -> held.

In a network namespace of its own: tools/lib/multicast python attacks.py BINARY CONFIG FOLDER lcm|serial
"""

import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

import equipoise
from stage import LcmWire, RunningRobot, SerialWire, signed

binary, config, folder, kind = sys.argv[1:5]
folder = pathlib.Path(folder)
subprocess.run([binary, "keygen", folder / "key", "--robot", "mbbr"], check=True, stdout=subprocess.DEVNULL)
for holder in ("anna", "berta"):
    make = [binary, "keygen", folder / holder, "--holder", holder, "--from", folder / "key"]
    subprocess.run(make, check=True, stdout=subprocess.DEVNULL)
wire = LcmWire() if kind == "lcm" else SerialWire()
LARGEST = 2**63 - 1


def start_send(holder, *arguments):
    command = [binary, "send", "--key", folder / holder, "--url", wire.sender_url, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process):
    out, err = process.communicate(timeout=60)
    return process.returncode, out + err


def send(holder, *arguments):
    """With the patience of a user of a busy machine: where others fill its cores, what goes through a
    pseudo-terminal waits for a thread of the kernel's, and `send` says when it was stopped for too long."""
    if "--timeout-s" not in arguments:
        arguments += ("--timeout-s", "10")
    for _ in range(5):
        status, text = ended(start_send(holder, *arguments))
        if "give it again" not in text:
            break
    return status, text


def disarmed_by_message(r, holder):
    """By one that is signed and counted as it has to be; what came too late or not at all is said again."""
    m = equipoise.signed_command_t.decode(wire.commands[-1])
    m.sender, m.action = 12345, m.DISARM
    for sequence in range(1, 51):
        latest = equipoise.command_session_t.decode(wire.announcements[-1])
        m.sequence, m.heard_ms, m.turn = sequence, latest.clock_ms, latest.turn
        wire.to_robot(signed(m, folder / "key", "mbbr", holder).encode())
        if r.comes_to(False, 0.1):
            return True
    return False


def robot(name="mbbr", *arguments, **options):
    return RunningRobot(binary, config, folder, name, wire.robot_url, *arguments, **options)


class Flood:
    """Calls f as often as it can, with a pause now and then for the others on this machine."""

    def __init__(self, f, pause_s=0.0005):
        self.f, self.pause_s, self.count, self.stop = f, pause_s, 0, threading.Event()
        self.thread = threading.Thread(target=self.run)

    def run(self):
        while not self.stop.is_set():
            self.f()
            self.count += 1
            time.sleep(self.pause_s)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()


def stale_arm():
    """The robot lies there when it is asked, and is put upright seconds later."""
    r = robot(tilt_rad=0.5)
    status, text = send("anna", "--arm")
    recorded = list(wire.commands)
    r.upright.set()
    on = r.ever_on(2.0)
    for data in recorded:
        wire.to_robot(data)
    on_again = r.ever_on(0.5)
    armed = send("anna", "--arm")[0] == 0 and r.comes_to(True)
    r.end()
    return {
        "sender was told": status == 1 and "does not arm" in text,
        "off when put upright": not on,
        "off when said again": not on_again,
        "the attack was heard": len(recorded) > 1,
        "a new request arms": armed,
    }


def replayed_arm():
    """Everything that was ever said is said again, right after the disarm and long after it."""
    r = robot()
    armed = send("anna", "--arm")[0] == 0 and r.comes_to(True)
    asked = [equipoise.signed_command_t.decode(data) for data in wire.commands]
    arms = [m.encode() for m in asked if m.action == m.ARM]
    off_at_once = disarmed_by_message(r, "berta")
    for data in arms:  # while the announcement they answer is still recent
        wire.to_robot(data)
    on_at_once = r.ever_on(0.3)
    armed = armed and send("anna", "--arm", "--drive-mps", "0.1")[0] == 0 and r.comes_to(True)
    disarmed = send("berta", "--disarm")[0] == 0
    off = r.comes_to(False)
    recorded = list(wire.commands)
    said = 0
    on = False
    for _ in range(20):
        for data in recorded:
            wire.to_robot(data)
            said += 1
        on = r.ever_on(0.05) or on
    names = r.end()
    return {
        "armed": armed,
        "disarmed": disarmed and off and off_at_once,
        "stays off": not on and not on_at_once,
        "many replays": said > 50,
        "holders are named": "anna asks for the motors" in names and "berta disarms" in names,
    }


def spoofed_announcement():
    """A robot that hears nothing, and an attacker who answers in its place."""
    r = robot()
    armed = send("anna", "--arm")[0] == 0
    disarm_of_before = send("anna", "--disarm")[0] == 0
    rearmed = send("anna", "--arm")[0] == 0
    recorded = list(wire.announcements)

    def answer():
        m = equipoise.command_session_t.decode(random.choice(recorded))
        choice = random.random()
        if choice < 0.7 and wire.commands:
            question = equipoise.signed_command_t.decode(wire.commands[-1])
            m.to, m.sequence, m.session = question.sender, question.sequence, question.session
            m.turn, m.turn_sender, m.turn_sequence = question.turn + 1, question.sender, question.sequence
            m.clock_ms += 100000
            m.state = equipoise.command_session_t.OFF
        elif choice < 0.85:
            m.sequence = m.turn = m.clock_ms = LARGEST
        wire.to_sender(m.encode())  # the rest: true, but recorded

    if kind == "lcm":
        os.kill(r.process.pid, signal.SIGSTOP)
    else:
        wire.deaf = True
    with Flood(answer, 0.002) as lies:
        status, text = send("anna", "--disarm", "--timeout-s", "1.5")
    still_on = r.enabled
    if kind == "lcm":
        os.kill(r.process.pid, signal.SIGCONT)
    else:
        wire.deaf = False
    with Flood(answer, 0.005) as more:
        through = send("anna", "--disarm", "--timeout-s", "10")
    off = r.comes_to(False)
    r.end()
    return {
        "armed, off and armed again": armed and disarm_of_before and rearmed,
        "no false success": status == 1 and "disarmed" not in text,
        "it was still on": still_on,
        "the owner is not locked out": through[0] == 0 and off,
        "many lies": lies.count > 100 and more.count > 0,
    }


def sequence_exhaustion():
    """Counters at their ends: forged by strangers, and signed by a careless holder of the robot's own key."""
    r = robot()
    armed = send("anna", "--arm")[0] == 0 and r.comes_to(True)
    last = equipoise.command_session_t.decode(wire.announcements[-1])
    command = equipoise.signed_command_t.decode(wire.commands[-1])
    said = 0
    for sequence in (LARGEST, LARGEST - 1, -1, -LARGEST - 1, command.sequence + 1001):
        for sender in (command.sender, 12345):
            for key_is_known in (False, True):
                latest = equipoise.command_session_t.decode(wire.announcements[-1])
                m = equipoise.signed_command_t.decode(command.encode())
                m.sequence, m.sender, m.heard_ms, m.turn = sequence, sender, latest.clock_ms, latest.turn
                m.action = equipoise.signed_command_t.DISARM
                if key_is_known:
                    signed(m, folder / "key", "mbbr", "anna")
                wire.to_robot(m.encode())
                said += 1
                time.sleep(0.03)
    latest = equipoise.command_session_t.decode(wire.announcements[-1])
    still_on = r.enabled
    taken = disarmed_by_message(r, "anna")
    again = send("anna", "--arm")[0] == 0 and r.comes_to(True)
    off = send("anna", "--disarm")[0] == 0 and r.comes_to(False)
    r.end()
    return {
        "armed": armed,
        "not one was obeyed": still_on and latest.turn == last.turn,
        "the same, counted well, is": taken,
        "owner arms and disarms": again and off,
        "many tries": said == 20,
    }


def two_robots():
    """One key for two robots: with one name, and with a name each."""
    first = robot("first")
    if kind == "lcm":
        second = robot("second")
        time.sleep(1.0)
        status, text = send("anna", "--arm")
        none_on = not first.enabled and not second.enabled
        refused = status == 1 and "two robots" in text
        second.end()
        second = robot("second", "--robot-name", "other")
    else:  # a line each, and the attacker carries messages over
        other = SerialWire()
        second = RunningRobot(binary, config, folder, "second", other.robot_url)
        refused = none_on = True
    time.sleep(1.0)
    armed = send("anna", "--robot", "mbbr", "--arm", "--drive-mps", "0.1", "--duration-s", "1")
    for _ in range(3):
        for data in list(wire.commands):
            wire.to_robot(data) if kind == "lcm" else other.to_robot(data)
        for data in list(wire.announcements) if kind != "lcm" else []:
            other.to_sender(data)
    second_on = second.ever_on(0.5)
    first_on = first.comes_to(True)
    if kind == "lcm":
        apart = send("anna", "--robot", "other", "--arm")[0] == 0 and second.comes_to(True)
        apart = apart and send("anna", "--robot", "mbbr", "--disarm")[0] == 0
        apart = apart and second.enabled and first.comes_to(False)
    else:
        apart = not second.enabled
        other.close()
    first.end()
    second.end()
    return {
        "ambiguity is refused": refused and none_on,
        "the named one arms": armed[0] == 0 and first_on,
        "the other does not": not second_on,
        "each obeys its own": apart,
    }


def two_senders():
    """One streams, another disarms: the stream ends and revives nothing."""
    r = robot()
    armed = send("anna", "--arm")[0] == 0
    if kind == "lcm":
        stream = start_send("anna", "--drive-mps", "0.1", "--duration-s", "20")
        time.sleep(1.0)
        disarmed = send("berta", "--disarm")
        off = r.comes_to(False)
        status, text = ended(stream)
        told = status == 1 and "berta has taken over" in text
    else:  # a line has one end: the first one's words arrive after the second one's
        streamed = send("anna", "--drive-mps", "0.1", "--duration-s", "0.5")
        held = list(wire.commands)
        disarmed = send("berta", "--disarm")
        off = r.comes_to(False)
        for data in held:
            wire.to_robot(data)
        told = streamed[0] == 0
    on = r.ever_on(1.0)
    again = send("anna", "--arm")[0] == 0 and r.comes_to(True)
    r.end()
    return {
        "armed": armed,
        "disarmed under the stream": disarmed[0] == 0 and off,
        "the first one is told": told,
        "stays off": not on,
        "arms anew, deliberately": again,
    }


def garbage_flood():
    """Noise, and true messages with bits turned, while the owner works."""
    r = robot()
    before = send("anna", "--disarm")[0] == 0
    noise = random.Random(5)
    templates = list(wire.commands) + list(wire.announcements)

    def babble():
        data = bytearray(noise.choice(templates))
        if noise.random() < 0.3:
            data = bytearray(noise.randbytes(noise.randrange(1, 250)))
        else:
            data[noise.randrange(len(data))] ^= 1 << noise.randrange(8)
        (wire.to_robot if noise.random() < 0.7 else wire.to_sender)(bytes(data))

    pause = 0.0005 if kind == "lcm" else 0.02  # a line at 115200 baud carries a hundred messages a second
    with Flood(babble, pause) as flood:
        on = r.ever_on(1.0)
        armed = send("anna", "--arm", "--timeout-s", "10")[0] == 0 and r.comes_to(True)
        drove = send("anna", "--drive-mps", "0.1", "--duration-s", "1", "--timeout-s", "10")[0] == 0
        disarmed = send("anna", "--disarm", "--timeout-s", "10")[0] == 0 and r.comes_to(False)
        on = on or r.ever_on(0.5)
    alive = r.process.poll() is None
    r.end()
    return {
        "commanded before": before,
        "no garbage armed it": not on,
        "the owner is heard": armed and drove and disarmed,
        "it survived": alive,
        "much garbage": flood.count > 100,
    }


ATTACKS = [
    stale_arm,
    replayed_arm,
    spoofed_announcement,
    sequence_exhaustion,
    two_robots,
    two_senders,
    garbage_flood,
]
if __name__ == "__main__":
    random.seed(1)
    result = {}
    for attack in ATTACKS:
        wire.commands.clear()
        wire.announcements.clear()
        result[attack.__name__] = attack()
    wire.close()
    print(json.dumps(result))
