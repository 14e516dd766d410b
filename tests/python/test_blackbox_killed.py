"""A log survives its robot: SIGKILL at any time, alone and on a busy machine."""

import contextlib
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from equipoise_robot.log import read_log
from equipoise_tools.lockstep_client import Robot
from started_lockstep import start_lockstep

pytestmark = pytest.mark.live


@contextlib.contextmanager
def busy(count):
    """So many processes that only count."""
    started = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.slow
@pytest.mark.parametrize(("kills", "load"), [(200, 0), (40, 10)], ids=["alone", "under_load"])
def test_sigkill_at_any_time_leaves_a_readable_log_that_lost_less_than_100_ms(root, tmp_path, kills, load):
    """Kills of a robot in real time. Lost: from the answer to the log's last tick to the last answer."""
    chance = random.Random(6)
    lost_ms = []
    message = Robot(0.0).sensors(0)
    with busy(load):
        for kill in range(kills):
            folder = tmp_path / str(kill)
            folder.mkdir()
            process, connection = start_lockstep(root, folder)
            steps = chance.randrange(1, 40)
            answered = []
            with connection:
                started = time.monotonic()
                for step in range(steps):
                    message.step, message.t_s = step, 0.005 * step
                    connection.send(message.encode())
                    connection.recv(512)
                    answered.append(time.monotonic())
                    time.sleep(max(0.0, started + 0.005 * (step + 1) - time.monotonic()))
                time.sleep(chance.random() * 0.004)
                process.send_signal(signal.SIGKILL)
                process.wait()
            log = read_log(folder / "run.lcm")
            whole = len(log["EQUIPOISE_TIMING"]) if "EQUIPOISE_TIMING" in log else 0
            assert "EQUIPOISE_RUN" in log
            assert whole <= steps
            by_clock_ms = 1e3 * (answered[-1] - answered[whole - 1] if whole else answered[-1] - started)
            lost_ms.append(max(5.0 * (steps - whole), by_clock_ms) if whole < steps else 0.0)
    assert len(lost_ms) == kills
    print(
        f"{kills} kills under load {load}: at most {max(lost_ms):.0f} ms lost, mean {np.mean(lost_ms):.1f} ms"
    )
    assert max(lost_ms) <= 100.0, sorted(lost_ms)[-10:]
