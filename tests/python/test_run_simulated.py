"""run --backend sim: what the board runs, in the world that sim simulates, in wall-clock time."""

import json
import signal
import subprocess
import time

import pytest
from equipoise_robot.log import read_log
from equipoise_tools import metrics, names

import lcm

pytestmark = pytest.mark.live


@pytest.fixture
def equipoise(root):
    def run(*arguments, code=0):
        command = [root / "build/host/equipoise", *arguments]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        return done

    return run


def practised(equipoise, robot, *arguments, code=0):
    options = ["--backend", "sim", "--fidelity", "built2025", "--telemetry", "off", "--json", "-"]
    return json.loads(
        equipoise("run", "--config", f"config/{robot}.toml", *options, *arguments, code=code).stdout
    )


@pytest.mark.parametrize("robot", ["mbbr", "edumip"])
def test_is_the_run_that_sim_simulates(equipoise, robot):
    """The same world, robot, seed and script, tick by tick: the extreme duty tells them apart."""
    script = ["--drive-mps", "0.1", "--duration-s", "4", "--robot", "7", "--seed", "3", "--log", "off"]
    run = practised(equipoise, robot, "--speed", "100", *script)
    simulated = ["sim", "--config", f"config/{robot}.toml", "--fidelity", "built2025", "--telemetry", "off"]
    sim = json.loads(equipoise(*simulated, "--json", "-", *script).stdout)
    same = ["ticks", "ended", "duty_max", "config_sha256", "estimator", "controller"]
    assert [run[key] for key in same] == [sim[key] for key in same]
    assert run["backend"] == "sim"


def test_keeps_pace_with_the_clock(equipoise):
    began = time.monotonic()
    practised(equipoise, "edumip", "--duration-s", "1.5", "--speed", "3", "--log", "off")
    assert time.monotonic() - began >= 0.5 - 0.005


def test_its_log_is_replayed_bit_for_bit(equipoise, tmp_path):
    log = tmp_path / "practice.lcm"
    faults = ["--fault", "count_jump@2", "--fault", "imu_off@3+0.5"]
    practised(equipoise, "edumip", "--duration-s", "4", "--speed", "100", "--log", log, *faults, code=1)
    assert json.loads(equipoise("replay", log, "--json", "-").stdout)["identical"] is True


def test_verdicts_on_sensors_are_in_journal_log_and_replay(equipoise, root, tmp_path):
    log = tmp_path / "verdicts.lcm"
    options = ["--config", "config/mbbr.toml", "--backend", "sim", "--speed", "100", "--duration-s", "6"]
    options += ["--fidelity", "built2025", "--drive-mps", "0.1", "--yaw-hz", "0.3", "--telemetry", "off"]
    options += ["--fault", "encoder_dead@3+0.4", "--fault", "bias_jump@5"]
    done = equipoise("run", *options, "--log", log, "--json", "-")
    run = json.loads(done.stdout)
    faults = [v for v in run["verdicts"] if v["hypothesis"] in ("encoder_1", "gyro_bias")]
    assert [(v["hypothesis"], v["taken"]) for v in faults] == [
        ("encoder_1", True),
        ("encoder_1", False),
        ("gyro_bias", True),
    ]
    for verdict in faults:
        assert verdict["ratio"] > verdict["bound"]
        assert verdict["ratio"] - verdict["runner_up_ratio"] >= 5.0
    replayed = equipoise("replay", log, "--json", "-")
    assert json.loads(replayed.stdout)["verdicts"] == run["verdicts"]
    said = [what for _, what in metrics.fault_events(read_log(log))]
    assert len(said) == len(run["verdicts"])
    for line in said:  # the journal's, then the summary's; replay's
        assert done.stderr.count(line) == 2 and replayed.stderr.count(line) == 1, line
    assert f"equipoise: {said[0]}" in done.stderr


def test_a_log_of_an_older_version_knows_no_verdicts(equipoise, tmp_path):
    log = tmp_path / "new.lcm"
    practised(equipoise, "edumip", "--duration-s", "2", "--speed", "100", "--log", log)
    whole = json.loads(equipoise("replay", log, "--json", "-").stdout)
    assert whole["verdicts"] == [] and names.FAULTS in read_log(log)
    old = lcm.EventLog(str(tmp_path / "old.lcm"), "w")
    for event in lcm.EventLog(str(log), "r"):
        if event.channel != names.FAULTS:
            old.write_event(event.timestamp, event.channel, event.data)
    old.close()
    replayed = json.loads(equipoise("replay", tmp_path / "old.lcm", "--json", "-").stdout)
    assert replayed == whole | {"log": str(tmp_path / "old.lcm"), "verdicts": None}


def test_a_fault_strikes_when_asked_for(equipoise):
    run = practised(
        equipoise,
        "edumip",
        "--speed",
        "100",
        "--duration-s",
        "4",
        "--log",
        "off",
        "--fault",
        "adc_open@2",
        code=1,
    )
    assert run["ended"] == "fell" or run["ended"] == "disarmed"
    assert 2.0 <= run["fell_at_s"] <= 2.1
    assert "battery_low" in run["reasons"]
    log_full = ["--fault", "log_full@2", "--log", "off"]
    run = practised(equipoise, "edumip", "--speed", "100", "--duration-s", "4", *log_full, code=1)
    assert run["reasons"] == ["log_failed"]


@pytest.mark.parametrize(
    "fault", ["nonsense@2", "imu_off", "imu_off@", "imu_off@-1", "imu_off@1+", "remote_lost@1"]
)
def test_a_fault_that_makes_no_sense_is_refused(equipoise, fault):
    done = equipoise("run", "--config", "config/mbbr.toml", "--backend", "sim", "--fault", fault, code=2)
    assert fault in done.stderr


@pytest.mark.parametrize("ending", ["finished", "disarmed", "interrupted", "killed"])
def test_run_replay_and_report_agree_on_how_it_ended(equipoise, root, tmp_path, ending):
    """What ticks cannot tell stands in the log: an interrupted run looks like a finished one."""
    log, result = tmp_path / "run.lcm", tmp_path / "run.json"
    command = [root / "build/host/equipoise", "run", "--config", "config/edumip.toml", "--backend", "sim"]
    command += ["--fidelity", "built2025", "--telemetry", "off", "--log", log, "--json", result]
    if ending in ("interrupted", "killed"):
        process = subprocess.Popen([*command, "--speed", "2"], cwd=root, stderr=subprocess.PIPE)
        while not log.exists() or log.stat().st_size < 100_000:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT if ending == "interrupted" else signal.SIGKILL)
        process.communicate()
    else:
        fault = ["--fault", "adc_open@2"] if ending == "disarmed" else []
        subprocess.run(
            [*command, "--duration-s", "3", "--speed", "100", *fault],
            cwd=root,
            capture_output=True,
            check=False,
        )
    replayed = json.loads(equipoise("replay", log, "--json", "-").stdout)
    summary = metrics.summarise(read_log(log))
    assert replayed["identical"] is True
    assert (summary.ended, summary.fell_at_s) == (replayed["ended"], replayed["fell_at_s"])
    assert [reason.replace(" ", "_") for reason in summary.reasons] == replayed["reasons"]
    if ending == "killed":
        assert names.VERDICT not in read_log(log)
        assert replayed["ended"] == "finished"  # what its ticks say
        return
    said = json.loads(result.read_text())
    keys = ("ended", "reasons", "fell", "fell_at_s")
    assert said["ended"] == ending
    assert [said[key] for key in keys] == [replayed[key] for key in keys]
