"""The firmware in real time, its sensors and motors at the test's end of a socket."""

import socket
import subprocess
import time


def start_lockstep(root, tmp_path, *arguments):
    path = tmp_path / "io.sock"
    command = [
        root / "build/host/equipoise",
        "run",
        "--config",
        root / "config/mbbr.toml",
        "--telemetry",
        "off",
    ]
    command += ["--backend", "lockstep", "--socket", path, "--log", tmp_path / "run.lcm"]
    process = subprocess.Popen(list(map(str, [*command, *arguments])), stderr=subprocess.DEVNULL)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.settimeout(30)
    while True:
        try:
            connection.connect(str(path))
            return process, connection
        except (FileNotFoundError, ConnectionRefusedError):
            assert process.poll() is None
            time.sleep(0.005)
