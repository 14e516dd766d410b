"""`run --backend lockstep` against an engine that balances, dies, stalls or talks nonsense; bad input."""

import json
import math
import resource
import socket
import subprocess
import time

import equipoise
import pytest
from equipoise_robot.log import read_log
from equipoise_tools import lockstep_client
from equipoise_tools.lockstep_client import Robot, balance

pytestmark = pytest.mark.live

PLAIN = ["--set", "motor.bridge=drive_brake", "--set", "friction.compensation=0.0"]
PLAIN += ["--set", "chain.gyro_delay_s=0.0"]  # this engine's IMU is not late


class Firmware:
    """`equipoise run --backend lockstep`, listening."""

    def __init__(self, root, tmp_path, *arguments, **popen):
        self.path = str(tmp_path / "io.sock")
        self.log = tmp_path / "run.lcm"
        command = [root / "build/host/equipoise", "run", "--config", root / "config/mbbr.toml"]
        command += ["--backend", "lockstep", "--socket", self.path, "--log", self.log, "--json", "-"]
        if "--telemetry" not in arguments:
            command += ["--telemetry", "off"]
        self.process = subprocess.Popen(
            list(map(str, [*command, *PLAIN, *arguments])),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **popen,
        )

    def connect(self):
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        connection.settimeout(30)
        while True:
            try:
                connection.connect(self.path)
                return connection
            except (FileNotFoundError, ConnectionRefusedError):
                assert self.process.poll() is None, self.process.stderr.read()
                time.sleep(0.01)

    def listening(self):
        """Waits until the socket is there, without taking the engine's place."""
        while "waiting for" not in self.process.stderr.readline():
            assert self.process.poll() is None
        return self

    def end(self):
        out, err = self.process.communicate(timeout=60)
        return self.process.returncode, json.loads(out) if out else None, err


def step(connection, robot, number, last=False, **changes):
    message = robot.sensors(number)
    message.last = last
    for name, value in changes.items():
        setattr(message, name, value)
    connection.send(message.encode())
    return equipoise.lockstep_motors_t.decode(connection.recv(512))


def advance(connection, robot, steps, first=0):
    for number in range(first, first + steps):
        motors = step(connection, robot, number)
        robot.advance(lockstep_client.np.array(motors.duty[:3]), motors.enable)
    return motors


def whole(log_path, ticks):
    """The log holds every tick and nothing torn."""
    log = read_log(log_path)
    assert log.notes == []
    assert log["EQUIPOISE_SENSORS"]["tick"].tolist() == list(range(ticks))
    assert log["EQUIPOISE_MOTORS"]["tick"].tolist() == list(range(ticks))
    return log


def test_an_external_engine_keeps_the_robot_upright_and_drives_it(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--drive-mps", "0.1").listening()
    robot = balance(firmware.path, 10.0)
    status, summary, _ = firmware.end()
    assert status == 0
    assert summary["armed"] and not summary["fell"] and summary["ticks"] == 2000
    assert math.hypot(*robot.theta[:2]) < 0.02
    # 9 s at 0.1 m/s, less the half of a start of 0.82 s at 0.6 m/s3 there and back
    assert lockstep_client.R * robot.phi[1] == pytest.approx(0.859, abs=0.03)
    whole(firmware.log, 2000)


def test_a_calibrated_bias_is_neither_lost_nor_doubled(root, tmp_path):
    """The engine's gyro is true: after the firmware's own calibration it is what the engine said."""
    firmware = Firmware(
        root, tmp_path, "--no-arm", "--set", "calibration.gyro_bias_rad_s=[0.03, -0.02, 0.01]"
    )
    with firmware.connect() as connection:
        for number in range(20):
            step(connection, Robot(0.0), number, last=number == 19, gyro_B_rad_s=[0.1, 0.2, 0.3])
    firmware.process.communicate(timeout=60)
    gyro = read_log(firmware.log).sensors()["gyro_B_rad_s"]
    assert gyro[-1].tolist() == pytest.approx([0.1, 0.2, 0.3], abs=0.002)


def test_duration_ends_the_run_with_last_and_motors_off(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--duration-s", "2")
    with firmware.connect() as connection:
        robot = Robot(0.01)
        motors = advance(connection, robot, 400)
        assert motors.enable
        farewell = step(connection, robot, 400)
    assert farewell.last and not farewell.enable and farewell.duty == (0.0,) * 4
    assert firmware.end()[0] == 0
    whole(firmware.log, 400)


def test_without_arm_the_motors_stay_off(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--no-arm")
    with firmware.connect() as connection:
        robot = Robot(0.01)
        assert not advance(connection, robot, 300).enable
        step(connection, robot, 300, last=True)
    status, summary, _ = firmware.end()
    assert (status, summary["armed"], summary["reasons"]) == (0, False, ["not_requested"])


@pytest.mark.parametrize(
    "changes",
    [
        {"gyro_B_rad_s": [0.0, float("nan"), 0.0]},
        {"specific_force_B_m_s2": [float("inf"), 0.0, 9.8]},
        {"wheel_angle_rad": [0.0, 0.0, float("nan"), 0.0]},
        {"battery_V": float("nan")},
        {"has_attitude": True, "attitude_WB_wxyz": [float("nan"), 0.0, 0.0, 0.0]},
    ],
)
def test_one_nan_from_the_engine_is_left_out(root, tmp_path, changes):
    firmware = Firmware(root, tmp_path)
    with firmware.connect() as connection:
        robot = Robot(0.01)
        assert advance(connection, robot, 200).enable
        motors = step(connection, robot, 200, **changes)
        assert motors.enable and all(abs(duty) <= 1.0 for duty in motors.duty)  # false of NaN
        step(connection, robot, 201, last=True)
    assert firmware.end()[0] == 0


@pytest.mark.parametrize(
    "changes",
    [{"gyro_B_rad_s": [0.0, float("nan"), 0.0]}, {"wheel_angle_rad": [0.0, 0.0, float("nan"), 0.0]}],
)
def test_nan_for_long_stops_the_motors(root, tmp_path, changes):
    firmware = Firmware(root, tmp_path)
    with firmware.connect() as connection:
        robot = Robot(0.01)
        assert advance(connection, robot, 200).enable
        for tick in range(200, 232):  # max_missed_imu and max_missed_encoders are 30
            motors = step(connection, robot, tick, **changes)
            if not motors.enable:
                break
        assert not motors.enable and motors.duty == (0.0,) * 4
    status, summary, _ = firmware.end()
    assert (status, summary["end"]) == (1, "fell")
    assert {"imu_stale", "encoder_stale"} & set(summary["reasons"])


def test_an_engine_that_dies_in_a_step_may_come_back(root, tmp_path):
    firmware = Firmware(root, tmp_path)
    with firmware.connect() as connection:
        robot = Robot(0.01)
        assert advance(connection, robot, 200).enable
        connection.send(robot.sensors(200).encode())  # and never reads the answer
    with firmware.connect() as connection:
        robot = Robot(0.01)
        assert not advance(connection, robot, 50).enable  # a new trial arms anew
        assert advance(connection, robot, 150, first=50).enable
        step(connection, robot, 200, last=True)
    status, summary, complaint = firmware.end()
    assert (status, summary["flights"], summary["end"]) == (0, 2, "finished")
    assert "hung up" in complaint and "Traceback" not in complaint
    whole(firmware.log, 201)
    whole(firmware.log.with_name("run-2.lcm"), 201)


def test_an_engine_that_stays_away_fails_the_job(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--timeout-s", "0.5")
    with firmware.connect() as connection:
        advance(connection, Robot(0.01), 10)
    status, summary, complaint = firmware.end()
    assert (status, summary["end"], summary["flights"]) == (1, "peer_gone", 1)
    assert "hung up before step 10; motors are off" in complaint
    whole(firmware.log, 10)


def test_an_engine_that_stalls_is_told_and_left(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--timeout-s", "0.5")
    with firmware.connect() as connection:
        advance(connection, Robot(0.01), 10)
        farewell = equipoise.lockstep_motors_t.decode(connection.recv(512))
        assert farewell.last and not farewell.enable
    status, summary, complaint = firmware.end()
    assert (status, summary["end"]) == (1, "timeout")
    assert "sent nothing for 500 ms" in complaint


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (b"hello", "a message of 5 bytes is no lockstep_sensors_t"),
        (bytes(len(equipoise.lockstep_sensors_t().encode())), "is no lockstep_sensors_t"),
        (equipoise.lockstep_sensors_t().encode()[:-1], "is no lockstep_sensors_t"),
        (equipoise.lockstep_sensors_t().encode() + b"x" * 5000, "is no lockstep_sensors_t"),
        (Robot(0.0).sensors(7).encode(), "step 7 where 5 was due"),
        (Robot(0.0).sensors(-1).encode(), "step -1 where 5 was due"),
    ],
    ids=["short", "type", "cut", "long", "ahead", "behind"],
)
def test_nonsense_is_answered_with_motors_off_and_a_reason(root, tmp_path, message, complaint):
    firmware = Firmware(root, tmp_path)
    with firmware.connect() as connection:
        advance(connection, Robot(0.01), 5)
        connection.send(message)
        farewell = equipoise.lockstep_motors_t.decode(connection.recv(512))
        assert farewell.last and not farewell.enable
    status, summary, err = firmware.end()
    assert (status, summary["end"]) == (1, "protocol")
    assert complaint in err
    whole(firmware.log, 5)


def test_nobody_comes(root, tmp_path):
    status, _, complaint = Firmware(root, tmp_path, "--timeout-s", "0.1").end()
    assert status == 1
    assert f"no physics engine connected to {tmp_path}/io.sock within 0.1 s" in complaint


def test_who_has_taken_its_place_keeps_the_path(root, tmp_path):
    first = Firmware(root, tmp_path, "--timeout-s", "2").listening()
    (tmp_path / "io.sock").unlink()
    second = Firmware(root, tmp_path).listening()
    assert first.end()[0] == 1
    with second.connect() as connection:
        step(connection, Robot(0.01), 0, last=True)
    assert second.end()[0] == 0


def test_a_path_in_use_is_refused_and_left_alone(root, tmp_path):
    first = Firmware(root, tmp_path).listening()
    status, _, complaint = Firmware(root, tmp_path).end()
    assert status == 2
    assert first.path in complaint and "another process listens there" in complaint
    with first.connect() as connection:
        step(connection, Robot(0.01), 0, last=True)
    assert first.end()[0] == 0


def test_a_file_in_the_way_is_refused_and_left_alone(root, tmp_path):
    (tmp_path / "io.sock").write_text("precious")
    status, _, complaint = Firmware(root, tmp_path).end()
    assert status == 2 and "exists and is no socket" in complaint
    assert (tmp_path / "io.sock").read_text() == "precious"


def test_a_socket_left_over_by_a_dead_process_is_replaced(root, tmp_path):
    firmware = Firmware(root, tmp_path).listening()
    firmware.process.kill()
    firmware.process.communicate()
    assert (tmp_path / "io.sock").is_socket()
    firmware = Firmware(root, tmp_path).listening()
    with firmware.connect() as connection:
        step(connection, Robot(0.01), 0, last=True)
    assert firmware.end()[0] == 0
    assert not (tmp_path / "io.sock").exists()


def test_a_full_disk_ends_the_run_with_a_whole_log(root, tmp_path):
    limit = 200_000
    firmware = Firmware(
        root, tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    with firmware.connect() as connection:
        robot = Robot(0.01)
        number = 0
        while not advance(connection, robot, 1, first=number).last:
            number += 1
            assert number < 5000
    status, summary, complaint = firmware.end()
    assert (status, summary["end"]) == (1, "log")
    assert f"{firmware.log}: log stopped: File too large" in complaint
    log = read_log(firmware.log)
    assert log.notes == []
    assert len(log["EQUIPOISE_SENSORS"]) > 50


def test_a_telemetry_url_that_cannot_be_opened_is_a_warning(root, tmp_path):
    firmware = Firmware(root, tmp_path, "--telemetry", "nonsense://nowhere")
    with firmware.connect() as connection:
        step(connection, Robot(0.01), 0, last=True)
    status, _, complaint = firmware.end()
    assert status == 0
    assert "warning: telemetry nonsense://nowhere cannot be opened" in complaint


def equipoise_run(root, *arguments):
    return subprocess.run(
        list(map(str, [root / "build/host/equipoise", *arguments])),
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_a_log_that_cannot_be_created_is_named(root, tmp_path):
    ended = equipoise_run(
        root,
        "sim",
        "--config",
        root / "config/mbbr.toml",
        "--log",
        tmp_path / "no" / "log.lcm",
        "--telemetry",
        "off",
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith(f"equipoise: {tmp_path}/no/log.lcm: log cannot be created: No such file")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("com_height_m = 0.100", "com_heigth_m = 0.100", ": robot.com_height_m: missing"),
        ("com_height_m = 0.100", "com_height_m = 0.100\nbatery = 1", ": robot.batery: unknown key"),
        (
            "com_height_m = 0.100",
            "com_height_m = 100.0",
            ": robot.com_height_m: 100 is out of range; allowed: 0.005 to 2",
        ),
        ("com_height_m = 0.100", "com_height_m = nan", "out of range"),
        ("com_height_m = 0.100", 'com_height_m = "tall"', ": robot.com_height_m: expected a number"),
        ("com_height_m = 0.100", "com_height_m = = 1", "mbbr.toml:"),
    ],
    ids=["missing", "unknown", "range", "nan", "type", "syntax"],
)
def test_a_wrong_configuration_names_file_line_key_and_range(root, tmp_path, old, new, complaint):
    text = (root / "config/mbbr.toml").read_text()
    assert text.count(old) == 1
    bad = tmp_path / "mbbr.toml"
    bad.write_text(text.replace(old, new))
    ended = equipoise_run(root, "run", "--config", bad, "--backend", "lockstep", "--socket", tmp_path / "s")
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"equipoise: {bad}:")
    assert ended.stderr.split(":")[2].strip().isdigit()
    assert complaint in ended.stderr and ended.stderr.count("\n") == 1


def test_run_says_what_it_needs(root):
    config = root / "config/mbbr.toml"
    for arguments, complaint in [
        (["--backend", "lockstep"], "--socket PATH"),
        ([], "--board FILE"),
        (["--board", root / "config/boards/robotics_cape_edumip.toml"], 'board.robot: "mip" where'),
        (["--board", "none.toml"], "none.toml: cannot be opened"),
        (["--backend", "lockstep", "--socket", "x", "--estimator", "truth"], "only a simulation knows"),
        (["--backend", "lockstep", "--socket", "x", "--estimator", "ekff"], "allowed: ekf, "),
        (["--backend", "lockstep", "--socket", "x" * 200], "1 to 107 characters"),
    ]:
        ended = equipoise_run(root, "run", "--config", config, *arguments)
        assert ended.returncode == 2, ended.stderr
        assert complaint in ended.stderr and ended.stderr.count("\n") == 1
