"""Runs `equipoise` of this build; robots whose logs tests share (conftest.py: robot, log)."""

import subprocess

CONFIGS = {"mbbr": "mbbr", "mip": "edumip"}


def equipoise(root, *arguments):
    command = [root / "build/host/equipoise", *arguments]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
