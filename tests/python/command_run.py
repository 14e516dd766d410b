"""One robot, its engine, its owner and an attacker on the same wire; prints what happened as JSON.

Runs in a network namespace of its own: tools/lib/multicast python command_run.py BINARY CONFIG FOLDER
"""

import json
import select
import socket
import subprocess
import sys
import threading
import time

import equipoise
import numpy as np
from equipoise_tools.lockstep_client import Robot

import lcm

binary, config, folder = sys.argv[1:4]
URL = "udpm://239.255.76.67:7667?ttl=0"
for name in ("key", "other"):
    subprocess.run([binary, "keygen", f"{folder}/{name}"], check=True, stdout=subprocess.DEVNULL)
firmware = subprocess.Popen(
    [
        binary,
        "run",
        "--config",
        config,
        "--backend",
        "lockstep",
        "--socket",
        f"{folder}/io.sock",
        "--telemetry",
        "off",
        "--log",
        f"{folder}/run.lcm",
        "--json",
        f"{folder}/run.json",
        "--command-key",
        f"{folder}/key",
        "--arm",
        "--set",
        "motor.bridge=drive_brake",
        "--set",
        "friction.compensation=0.0",
        "--set",
        "chain.gyro_delay_s=0.0",
    ],
    stderr=subprocess.DEVNULL,
    stdout=subprocess.DEVNULL,
)
enabled, stop = [False], threading.Event()


def engine():
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    while True:
        try:
            connection.connect(f"{folder}/io.sock")
            break
        except OSError:
            time.sleep(0.01)
    robot, step = Robot(0.01), 0
    while True:
        message = robot.sensors(step)
        message.last = stop.is_set()
        connection.send(message.encode())
        motors = equipoise.lockstep_motors_t.decode(connection.recv(512))
        robot.advance(np.array(motors.duty[:3]), motors.enable)
        enabled[0] = motors.enable
        if message.last:
            return
        step += 1
        time.sleep(0.005)


thread = threading.Thread(target=engine)
thread.start()
wire = lcm.LCM(URL)
sessions, recorded = [], []


def hear_session(_, data):
    sessions.append(equipoise.command_session_t.decode(data))


wire.subscribe("EQUIPOISE_COMMAND_SESSION", hear_session)
wire.subscribe("EQUIPOISE_SIGNED_COMMAND", lambda _, data: recorded.append(data))


def listen(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if select.select([wire], [], [], 0.01)[0]:  # handle_timeout would hold the interpreter's lock
            wire.handle()


def send(key, *arguments):
    command = [binary, "send", "--key", f"{folder}/{key}", *arguments]
    return subprocess.run(command, capture_output=True, text=True)


result = {}
listen(1.0)
result["before"] = enabled[0]
stranger = send("other", "--arm", "--duration-s", "0.2", "--timeout-s", "0.5")
result["stranger"] = [stranger.returncode, stranger.stderr]
listen(0.3)
result["after_stranger"] = enabled[0]
owner = send("key", "--arm", "--drive-mps", "0.1", "--duration-s", "0.5")
result["owner"] = [owner.returncode, owner.stdout + owner.stderr]
listen(0.3)
result["after_owner"] = enabled[0]
disarm = send("key", "--disarm")
result["disarm"] = disarm.returncode
listen(0.3)
result["after_disarm"] = enabled[0]
accepted = sessions[-1].accepted
attacks = 0
for i in range(1000):
    data = bytearray(recorded[i % len(recorded)])
    if i % 2:
        data[i % len(data)] ^= 1 << (i % 8)
    wire.publish("EQUIPOISE_SIGNED_COMMAND", bytes(data))
    attacks += 1
    if i % 20 == 0:
        listen(0.02)
listen(0.5)
result["attacks"] = attacks
result["accepted"] = sessions[-1].accepted - accepted
result["refused"] = sessions[-1].refused
result["after_attacks"] = enabled[0]
stop.set()
thread.join()
firmware.wait()
print(json.dumps(result))
