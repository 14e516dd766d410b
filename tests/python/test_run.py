"""The simulator, its log and the report agree; tools/run leaves what it promises."""

import json
import os
import shutil
import signal
import subprocess
import time

import pytest
from equipoise_robot.log import read_log
from equipoise_tools.metrics import summarise

pytestmark = pytest.mark.live


@pytest.fixture(scope="session")
def equipoise(root):
    binary = root / "build" / "host" / "equipoise"
    assert binary.exists(), "build first: cmake --build build/host"
    return binary


@pytest.fixture
def run_command(root):
    """tools/run with arguments; removes the folders it made."""
    logs = root / "logs"
    before = set(logs.glob("*")) if logs.exists() else set()
    latest = (logs / "latest").readlink() if (logs / "latest").is_symlink() else None

    def run(*arguments):
        command = [root / "tools/run", "--telemetry", "off", *arguments]
        result = subprocess.run(command, capture_output=True, text=True, timeout=600)
        made = (
            [path for path in set(logs.glob("*")) - before if not path.is_symlink()] if logs.exists() else []
        )
        return result, made

    yield run
    for path in set(logs.glob("*")) - before:
        path.unlink() if path.is_symlink() or path.is_file() else shutil.rmtree(path)
    if latest is not None:
        (logs / "latest").unlink(missing_ok=True)
        (logs / "latest").symlink_to(latest)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--config", "config/mbbr.toml", "--yaw-hz", "1", "--drive-mps", "0.1", "--compare"),
        (
            "--config",
            "config/mbbr.toml",
            "--yaw-hz",
            "-0.5",
            "--estimator",
            "kf_attitude",
            "--fidelity",
            "thesis",
        ),
    ],
    ids=["ekf", "kf_attitude"],
)
def test_the_report_computes_from_the_log_what_the_simulator_computed(equipoise, root, tmp_path, arguments):
    log, summary = tmp_path / "run.lcm", tmp_path / "summary.json"
    command = [
        equipoise,
        "sim",
        *arguments,
        "--duration-s",
        "10",
        "--telemetry",
        "off",
        "--log",
        log,
        "--json",
        summary,
    ]
    subprocess.run(command, cwd=root, check=True, capture_output=True)
    told = json.loads(summary.read_text())
    read = read_log(log)
    assert read.notes == []
    found = summarise(read)
    assert found.robot == told["robot"]
    assert found.ticks == told["ticks"]
    assert found.ended == told["ended"]
    assert (found.fell_at_s is not None) == told["fell"]
    # The log's time stamps are whole microseconds: 2e-7 of the five seconds that count.
    assert found.yaw_rate_mean_hz == pytest.approx(told["yaw_rate_mean_hz"], rel=5e-7)
    assert found.position_rmse_m == pytest.approx(told["position_rmse_m"], rel=1e-9)
    assert found.duty_max == pytest.approx(told["duty_max"], rel=1e-12)
    assert found.saturated_fraction == pytest.approx(told["saturated_fraction"], rel=1e-12)
    controlling = found.estimators[told["estimator"]]
    assert controlling.attitude_rmse_rad == pytest.approx(told["attitude_rmse_rad"], rel=1e-9)
    assert controlling.speed_rmse_m_s == pytest.approx(told["ball_speed_rmse_m_s"], rel=1e-9)
    beside = {name: errors for name, errors in told["estimators"].items() if name != "truth"}
    assert set(found.estimators) == set(beside)
    for name, errors in beside.items():
        assert found.estimators[name].attitude_rmse_rad == pytest.approx(
            errors["attitude_rmse_rad"], rel=1e-9
        )
        assert found.estimators[name].speed_rmse_m_s == pytest.approx(errors["ball_speed_rmse_m_s"], rel=1e-9)


def test_the_run_command_leaves_log_summary_and_report(run_command):
    result, (folder,) = run_command("--duration-s", "6", "--seed", "3")
    assert result.returncode == 0, result.stderr
    assert {path.name for path in folder.iterdir()} == {
        "run.lcm",
        "summary.json",
        "report.png",
        "report.html",
    }
    told = json.loads((folder / "summary.json").read_text())
    assert (told["seed"], told["duration_s"]) == (3, 6.0)
    assert (told["yaw_hz"], told["drive_mps"]) == (1.0, 0.1)  # the main job, where not told otherwise
    for name in ("run.lcm", "summary.json", "report.png", "report.html"):
        assert str(folder / name) in result.stdout


def test_the_run_command_keeps_stdout_for_json(run_command):
    result, _ = run_command("--duration-s", "6", "--json", "-", "--yaw-hz=0.5")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["yaw_hz"] == 0.5


def test_an_interrupted_run_still_leaves_its_report(root, run_command):
    logs = root / "logs"

    def logged():  # logs/latest is a second name of one of them
        return {log.resolve() for log in logs.glob("*/run.lcm")}

    before = logged()
    command = [root / "tools/run", "--telemetry", "off", "--realtime", "--duration-s", "600"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )

    def running():
        return [log for log in logged() - before if log.stat().st_size > 0]

    while process.poll() is None and not running():
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as the terminal does on Ctrl-C
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert b"report.html" in out
    (log,) = running()
    assert json.loads((log.parent / "summary.json").read_text())["interrupted"]
    assert (log.parent / "report.png").exists()


@pytest.mark.parametrize(
    "arguments", [["--no-such-option"], ["--yaw-hz", "fast"], ["--config", "absent.toml"]]
)
def test_wrong_usage_of_the_run_command_leaves_nothing(run_command, arguments):
    result, made = run_command(*arguments)
    assert result.returncode == 2
    assert made == []
    assert arguments[0] in result.stderr or arguments[-1] in result.stderr


@pytest.mark.parametrize("turn", [("--yaw-rad-s", "5", "--compare"), ("--path", "circle")])
def test_the_default_yaw_rate_gives_way_to_what_excludes_it(run_command, turn):
    """README's second picture was refused: its own yaw rate met the default one."""
    result, made = run_command(
        "--config", "config/edumip.toml", "--drive-mps", "0.2", "--duration-s", "5", *turn
    )
    assert result.returncode == 0, result.stderr
    assert (made[0] / "report.png").exists()
