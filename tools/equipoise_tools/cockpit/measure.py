"""python -m equipoise_tools.cockpit.measure: what the cockpit costs on this machine, as JSON.

Starts a cockpit with a running robot and a Chromium without a window (its GPU is the processor), drives, and
measures for a while. Needs playwright (tools/requirements-optional.txt) and chromium.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from ..entry import leave
from ..paths import UserError

CHROMIUM = "/usr/bin/chromium"
# WebGL by the processor, and the page's layers put together without it: ten times cheaper than with.
CHROMIUM_ARGUMENTS = ["--disable-gpu", "--enable-unsafe-swiftshader", "--no-sandbox"]
SETTLE_S = 5.0


def cpu_s(pid: int) -> float:
    """Of the process alone."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def below(pid: int) -> list[int]:
    """The process and everything it has started."""
    children = [
        int(child)
        for task in Path(f"/proc/{pid}/task").iterdir()
        for child in (task / "children").read_text().split()
    ]
    return [pid, *(p for child in children for p in below(child))]


def total_cpu_s(pids: list[int]) -> float:
    return sum(cpu_s(pid) for pid in pids if Path(f"/proc/{pid}").exists())


def measure(seconds: float, width: int, height: int, arguments: list[str]) -> dict:
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise UserError("playwright is not installed: tools/requirements-optional.txt") from None
    command = [sys.executable, "-m", "equipoise_tools.cockpit", "--port", "0", "--arm", *arguments]
    cockpit = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        link = re.search(r"http://\S+", cockpit.stdout.readline())
        if link is None:
            raise UserError("the cockpit did not start")
        with sync_playwright() as playwright:
            before = set(below(os.getpid()))
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=CHROMIUM_ARGUMENTS)
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(link[0])
            page.click("#take")
            page.wait_for_selector("#state[data-state=armed]")
            page.keyboard.down("w")
            time.sleep(SETTLE_S)
            page.evaluate("cockpit.latency_ms.length = 0")
            chromium = sorted(set(below(os.getpid())) - before - set(below(cockpit.pid)))
            counts = "[cockpit.pictures, cockpit.drawn, cockpit.frames]"
            first, python_s, chromium_s = page.evaluate(counts), cpu_s(cockpit.pid), total_cpu_s(chromium)
            began_s = time.monotonic()
            time.sleep(seconds)
            last, elapsed_s = page.evaluate(counts), time.monotonic() - began_s
            python_s, chromium_s = cpu_s(cockpit.pid) - python_s, total_cpu_s(chromium) - chromium_s
            latency = sorted(page.evaluate("cockpit.latency_ms"))
            browser.close()
    finally:
        cockpit.terminate()
        cockpit.wait()
    pictures, drawn, frames = (b - a for a, b in zip(first, last, strict=True))

    def quantile(q: float) -> float | None:
        return latency[round(q * (len(latency) - 1))] if latency else None

    return {
        "seconds": elapsed_s,
        "load_average": os.getloadavg()[0],
        "pictures_per_s": pictures / elapsed_s,
        "pictures_with_a_new_tick_per_s": drawn / elapsed_s,
        "frames_received_per_s": frames / elapsed_s,
        "python_cpu_share": python_s / elapsed_s,
        "chromium_cpu_ms_per_picture": 1000 * chromium_s / pictures if pictures else None,
        "tick_to_screen_ms": {
            name: quantile(q) for name, q in (("median", 0.5), ("p99", 0.99), ("max", 1.0))
        },
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.cockpit.measure", description="What the cockpit costs, as JSON."
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="(default: %(default)s)")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=800)
    options, rest = parser.parse_known_args(arguments)
    try:
        print(json.dumps(measure(options.seconds, options.width, options.height, rest), indent=2))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    leave(main)
