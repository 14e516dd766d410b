"""A stage for attacks: robots running in a small engine, holders with `equipoise send`, and the wire between
them in the attacker's hands: an LCM group, which he hears and speaks on, or serial lines, which he is."""

from __future__ import annotations

import hashlib
import os
import select
import socket
import subprocess
import threading
import time
import tty

import equipoise
import numpy as np
from equipoise_tools.lockstep_client import Robot

import lcm

URL = "udpm://239.255.76.67:7667?ttl=0"
COMMANDS, SESSIONS = "EQUIPOISE_SIGNED_COMMAND", "EQUIPOISE_COMMAND_SESSION"
BAUD = 115200


def crc(data: bytes) -> int:
    value = 0xFFFF
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    return value


def to_frame(message: bytes) -> bytes:
    body = bytes([len(message)]) + message
    return b"\xea\x11" + body + crc(body).to_bytes(2, "big")


def from_frames(stream: bytearray) -> list[bytes]:
    """Whole messages at the front, which are taken from the stream."""
    messages = []
    while (at := stream.find(b"\xea\x11")) >= 0 and len(stream) >= at + 3:
        end = at + 5 + stream[at + 2]
        if len(stream) < end:
            break
        body = bytes(stream[at + 2 : end - 2])
        whole = crc(body).to_bytes(2, "big") == bytes(stream[end - 2 : end])
        messages += [body[1:]] if whole else []
        del stream[: end if whole else at + 1]
    return messages


def signed(message, key_file, robot: str, holder: str):
    """As a holder of the robot's own key would sign it."""
    secret = bytes.fromhex(key_file.read_text().split()[3])
    key = hashlib.blake2b(f"commands of {holder}".encode(), digest_size=32, key=secret).digest()
    message.holder = holder.encode().ljust(16, b"\0")
    message.mac = bytes(16)
    proved = robot.encode() + b"\0" + message.encode()
    message.mac = hashlib.blake2b(proved, digest_size=16, key=key).digest()
    return message


class LcmWire:
    def __init__(self):
        self.commands, self.announcements = [], []
        self.lcm = lcm.LCM(URL)
        self.lcm.subscribe(COMMANDS, lambda _, data: self.commands.append(data))
        self.lcm.subscribe(SESSIONS, lambda _, data: self.announcements.append(data))
        self.robot_url = self.sender_url = URL
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.listen)
        self.thread.start()

    def listen(self):
        while not self.stopped.is_set():
            if select.select([self.lcm], [], [], 0.01)[0]:
                self.lcm.handle()

    def to_robot(self, data: bytes):
        self.lcm.publish(COMMANDS, data)

    def to_sender(self, data: bytes):
        self.lcm.publish(SESSIONS, data)

    def close(self):
        self.stopped.set()
        self.thread.join()


class SerialWire:
    """The robot's line and a holder's, joined by the attacker, message by message."""

    def __init__(self):
        self.commands, self.announcements = [], []
        self.deaf = False  # commands are heard and not passed on
        self.robot_fd, self.robot_url = self.line()
        self.sender_fd, self.sender_url = self.line()
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.join)
        self.thread.start()

    def line(self):
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self.slaves = [*getattr(self, "slaves", []), slave]
        return master, f"serial:{os.ttyname(slave)}:{BAUD}"

    def join(self):
        streams = {self.robot_fd: bytearray(), self.sender_fd: bytearray()}
        while not self.stopped.is_set():
            for fd in select.select(list(streams), [], [], 0.01)[0]:
                streams[fd] += os.read(fd, 4096)
                for message in from_frames(streams[fd]):
                    if fd == self.robot_fd:
                        self.announcements.append(message)
                        self.to_sender(message)
                    else:
                        self.commands.append(message)
                        if not self.deaf:
                            self.to_robot(message)

    @staticmethod
    def write(fd: int, data: bytes):
        try:
            os.write(fd, data)
        except BlockingIOError:
            time.sleep(0.001)  # the line is full: lost, as on a line

    def to_robot(self, data: bytes):
        self.write(self.robot_fd, to_frame(data[:255]))

    def to_sender(self, data: bytes):
        self.write(self.sender_fd, to_frame(data[:255]))

    def close(self):
        self.stopped.set()
        self.thread.join()
        for fd in (self.robot_fd, self.sender_fd, *self.slaves):
            os.close(fd)


class RunningRobot:
    """`equipoise run` against an engine of its own, which it thinks is its body."""

    def __init__(self, binary, config, folder, name, url, *arguments, tilt_rad=0.01):
        self.enabled, self.tilt_rad = False, tilt_rad
        self.path, self.log = f"{folder}/{name}.sock", f"{folder}/{name}.lcm"
        command = [binary, "run", "--config", config, "--backend", "lockstep", "--socket", self.path]
        command += ["--telemetry", "off", "--log", self.log, "--command-key", f"{folder}/key"]
        command += ["--command-url", url, "--set", "motor.bridge=drive_brake", *arguments]
        command += ["--set", "friction.compensation=0.0"]
        command += ["--set", "chain.gyro_delay_s=0.0"]  # the engine's gyro is live
        self.said = open(f"{folder}/{name}.txt", "w+")  # noqa: SIM115  closed in end()
        self.process = subprocess.Popen(command, stderr=self.said, stdout=subprocess.DEVNULL)
        self.stopped = threading.Event()
        self.upright = threading.Event()  # put there by a hand
        self.thread = threading.Thread(target=self.drive)
        self.thread.start()

    def drive(self):
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        while True:
            try:
                connection.connect(self.path)
                break
            except OSError:
                if self.process.poll() is not None:
                    return
                time.sleep(0.01)
        robot, step = Robot(self.tilt_rad), 0
        while True:
            if self.upright.is_set() and robot.held:
                robot.theta = np.array([0.01, 0.0, 0.0])
            if not self.enabled and not robot.held:  # a hand catches it
                robot.held, robot.omega, robot.phi_dot = True, np.zeros(3), np.zeros(3)
                robot.omega_dot, robot.phi_ddot = np.zeros(3), np.zeros(3)
                robot.theta = np.array([0.01, 0.0, 0.0])
            message = robot.sensors(step)
            message.last = self.stopped.is_set()
            try:
                connection.send(message.encode())
                motors = equipoise.lockstep_motors_t.decode(connection.recv(512))
            except (OSError, ValueError):
                return
            robot.advance(np.array(motors.duty[:3]), motors.enable)
            self.enabled = motors.enable
            if message.last:
                return
            step += 1
            time.sleep(0.005)

    def ever_on(self, seconds: float) -> bool:
        return self.comes_to(True, seconds)

    def comes_to(self, enabled: bool, seconds: float = 5.0) -> bool:
        """What it has confirmed reaches its body a tick later; on a busy machine, much later."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.enabled == enabled:
                return True
            time.sleep(0.002)
        return False

    def end(self) -> str:
        self.stopped.set()
        self.thread.join()
        self.process.wait(timeout=20)
        self.said.seek(0)
        text = self.said.read()
        self.said.close()
        return text
