"""The installed wheel, where there is no repository: run by tools/wheel-test in an environment of its own."""

import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import equipoise_robot as eq
import numpy as np
import pytest

ROOT = Path(os.environ["EQUIPOISE_ROOT"])
ONE_THREAD = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
CONFIGURATIONS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml"}


def command(*arguments) -> dict:
    ran = subprocess.run(
        [ROOT / "build/host/equipoise", *map(str, arguments), "--json", "-"],
        capture_output=True,
        cwd=ROOT,
        check=True,
    )
    return json.loads(ran.stdout)


def test_the_package_is_the_installed_one():
    package = Path(eq.__file__).parent
    assert package.is_relative_to(sys.prefix)
    assert package.parent not in {ROOT / "python", ROOT / "build/host/python"}
    assert {"py.typed", "_core.pyi", "config", "lcm"} <= {file.name for file in package.iterdir()}
    assert eq.__version__ == version("equipoise-robot")


@pytest.mark.parametrize("robot", CONFIGURATIONS)
def test_numbers_are_the_commands(robot):
    options = ["--config", CONFIGURATIONS[robot], "--drive-mps", 0.1, "--duration-s", 8, "--seed", 4]
    said = command("sim", *options, "--log", "off", "--telemetry", "off")
    ours = eq.run(robot, drive_mps=0.1, duration_s=8.0, seed=4).to_dict()
    for name in ("log", "real_time_factor"):
        said.pop(name, None), ours.pop(name, None)
    assert ours == said
    design = command("design", "--config", CONFIGURATIONS[robot], "--last-hz", 0)
    assert eq.design(robot, last_hz=0.0).to_dict() == design


def test_logs_of_the_command_are_read(tmp_path):
    file = tmp_path / "run.lcm"
    command("sim", "--config", CONFIGURATIONS["mip"], "--duration-s", 2, "--log", file, "--telemetry", "off")
    log = eq.Log(file)
    assert log.notes == []
    assert log.run.robot == "mip"
    np.testing.assert_array_equal(log.sensors(), eq.run("mip", duration_s=2.0, record=True).log.sensors())
    assert len(log.to_pandas()) == 400


def test_an_hours_rotated_log_is_read_in_500_megabytes(tmp_path):
    """The peak is that of the process that reads it, tables and sensors included."""
    minute = tmp_path / "minute.lcm"
    command(
        "sim", "--config", CONFIGURATIONS["mbbr"], "--duration-s", 60, "--log", minute, "--telemetry", "off"
    )
    first = tmp_path / "run.lcm"
    first.write_bytes(10 * minute.read_bytes())
    later = tmp_path / "later"  # its events are numbered on
    later.write_bytes(first.read_bytes()[:4] + (1).to_bytes(8, "big") + first.read_bytes()[12:])
    for part in range(1, 6):
        (tmp_path / f"run.{part:04d}.lcm").hardlink_to(later)
    program = """
import resource, sys
import equipoise_robot as eq
log = eq.Log(sys.argv[1])
lean = log["EQUIPOISE_STATE"]["theta_rad"][:, 0]
tables = log.to_pandas(every=10), log.to_pandas("sensors", every=10)
peak_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(lean.size, *map(len, tables), len(log.notes), peak_MB)
"""
    ran = subprocess.run(
        [sys.executable, "-c", program, first], capture_output=True, text=True, check=True, env=ONE_THREAD
    )
    *counts, peak_MB = map(float, ran.stdout.split())
    assert counts == [720_000, 72_000, 72_000, 0]
    print(f"{6 * first.stat().st_size >> 20} MB of log, {peak_MB:.0f} MB of memory")
    assert peak_MB <= 500


def test_sweep_in_processes():
    table = eq.sweep("mip", {"seed": [1, 2, 3]}, jobs=2, duration_s=2.0, progress=False)
    assert table["ended"].tolist() == ["finished"] * 3


@pytest.mark.parametrize("name", ["Mbbr", "Mip"])
@pytest.mark.parametrize("imports, module", [("import equipoise_robot", ""), ("", "equipoise_robot:")])
def test_importing_the_package_registers_its_environments(name, imports, module):
    program = f"""
{imports}
import gymnasium
env = gymnasium.make("{module}Equipoise-{name}-v0")
env.reset(seed=1)
print(*env.step(env.action_space.sample())[2:4])
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.stdout.endswith("False False\n"), ran.stderr


def test_type_checkers_know_the_package(tmp_path):
    (tmp_path / "user.py").write_text("""
import equipoise_robot as eq

run: eq.Run = eq.run("mip", seed=1)
height: str = run.attitude_rmse_rad


def control(tick: eq.ControllerTick) -> list[float]:
    return [float(tick.estimate.theta_rad[0]), tick.u]


eq.run("mip", controller=control)
""")
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "user.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    complaints = [line.split(":")[1] for line in ran.stdout.splitlines() if ": error:" in line]
    assert complaints == ["5", "9"], ran.stdout + ran.stderr
