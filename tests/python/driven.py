"""Runs `equipoise` of this build; robots whose logs tests share (conftest.py); real robots' logs."""

import os
import subprocess
import tomllib
from pathlib import Path

import pytest
from equipoise_tools import reality

CONFIGS = {"mbbr": "mbbr", "mip": "edumip"}


def equipoise(root, *arguments):
    command = [root / "build/host/equipoise", *arguments]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)


def real_logs(root):
    return Path(os.environ.get("EQUIPOISE_REAL_LOGS", root.parent / "shared/real"))


def real_log(root, map_file):
    """The log that a map is for; without it the test skips."""
    source = tomllib.loads(map_file.read_text())["source"]
    if log := reality.found(real_logs(root), source):
        return log
    return pytest.skip(f"no {source['path']}: docs/reality.md says where it is from")


def rewritten(path, log, change, run=lambda message: None):
    """The log with every message changed, its description by `run`; where one says False, it is left out."""
    import equipoise as types
    from equipoise_robot.channels import RUN

    import lcm

    kinds = [getattr(types, name) for name in dir(types) if name.endswith("_t")]
    of = {kind._get_packed_fingerprint(): kind for kind in kinds}
    out = lcm.EventLog(str(path), "w", overwrite=True)
    for event in lcm.EventLog(str(log)):
        message = of[event.data[:8]].decode(event.data)
        if (run if event.channel == RUN else change)(message) is not False:
            out.write_event(event.timestamp, event.channel, message.encode())
    out.close()
    return path


def every_float(number):
    """A change for rewritten(): this number in place of each."""

    def change(message):
        for name in message.__slots__:
            value = getattr(message, name)
            if isinstance(value, float):
                setattr(message, name, number)
            elif isinstance(value, (list, tuple)) and value and isinstance(value[0], float):
                setattr(message, name, [number] * len(value))

    return change
