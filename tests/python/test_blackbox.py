"""The log holds everything: replayed bit for bit, readable after SIGKILL, rotated, converted."""

import csv
import json
import re
import struct
import subprocess

import equipoise
import mcap.reader
import numpy as np
import pytest
from equipoise_robot.log import read_log
from equipoise_tools.lockstep_client import Robot
from started_lockstep import start_lockstep

SCENARIOS = [
    (estimator, controller, fidelity)
    for estimator in ("ekf", "ekf13", "ekf13_published", "kf_attitude", "truth")
    for controller, fidelity in (("scheduled", "nominal"), ("thesis", "thesis"), ("scheduled", "ideal"))
]


def equipoise_run(root, *arguments):
    return subprocess.run(
        list(map(str, [root / "build/host/equipoise", *arguments])),
        capture_output=True,
        text=True,
        timeout=120,
    )


def simulate(root, log, *arguments, seconds=6, config=None):
    common = [
        "--config",
        config or root / "config/mbbr.toml",
        "--telemetry",
        "off",
        "--log",
        log,
        "--duration-s",
        seconds,
    ]
    ended = equipoise_run(root, "sim", *common, *arguments)
    assert ended.returncode in (0, 1), ended.stderr  # 1: it fell, which has to replay as well
    return log


def replay(root, log, *arguments):
    ended = equipoise_run(root, "replay", log, "--json", "-", *arguments)
    assert ended.stdout, ended.stderr
    return ended.returncode, json.loads(ended.stdout)


@pytest.mark.parametrize(("estimator", "controller", "fidelity"), SCENARIOS)
def test_every_scenario_replays_bit_for_bit(root, tmp_path, estimator, controller, fidelity):
    choices = ["--estimator", estimator, "--controller", controller, "--fidelity", fidelity]
    log = simulate(root, tmp_path / "run.lcm", *choices, "--yaw-hz", "0.75", "--drive-mps", "0.1")
    status, result = replay(root, log)
    assert (status, result["identical"], result["first_difference"]) == (0, True, None)
    assert result["ticks"] == len(read_log(log)["EQUIPOISE_SENSORS"]) > 300
    assert (result["estimator"], result["controller"]) == (estimator, controller)


def test_overrides_are_in_the_log(root, tmp_path):
    overrides = ["--set", "friction.compensation=0.7", "--set", "safety.max_tilt_rad=0.5"]
    log = simulate(root, tmp_path / "run.lcm", *overrides)
    assert replay(root, log)[1]["identical"]


def rewrite(log, channel, tick, change):
    """The log with one message changed."""
    data = bytearray(log.read_bytes())
    at = 0
    while at < len(data):
        name_size, size = struct.unpack_from(">II", data, at + 20)
        body = at + 28 + name_size
        if data[at + 28 : body] == channel.encode():
            kind = getattr(equipoise, channel[10:].lower() + "_t")
            message = kind.decode(bytes(data[body : body + size]))
            if message.tick == tick:
                change(message)
                data[body : body + size] = message.encode()
        at = body + size
    log.write_bytes(data)


def test_replay_names_the_first_field_and_tick_that_differ(root, tmp_path):
    log = simulate(root, tmp_path / "run.lcm")

    def last_bit(message):
        duty = list(message.duty)
        duty[1] = float(np.nextafter(duty[1], 2.0))
        message.duty = duty

    rewrite(log, "EQUIPOISE_MOTORS", 700, last_bit)
    status, result = replay(root, log)
    assert status == 1 and not result["identical"]
    assert (result["first_difference"]["tick"], result["first_difference"]["field"]) == (
        700,
        "EQUIPOISE_MOTORS.duty[1]",
    )


def test_a_changed_sensor_shows_in_the_estimate_of_its_tick(root, tmp_path):
    log = simulate(root, tmp_path / "run.lcm")

    def one_count(message):
        message.gyro_counts = [message.gyro_counts[0] + 1.0, *message.gyro_counts[1:]]

    rewrite(log, "EQUIPOISE_SENSORS", 500, one_count)
    difference = replay(root, log)[1]["first_difference"]
    assert difference["tick"] == 500
    assert difference["field"].startswith("EQUIPOISE_STATE.")


def test_another_filter_is_tried_on_the_same_run(root, tmp_path):
    compared = tmp_path / "compared.json"
    log = simulate(
        root, tmp_path / "run.lcm", "--yaw-hz", "0.75", "--compare", "--json", compared, seconds=20
    )
    status, result = replay(root, log, "--estimator", "ekf13_published")
    assert status == 0 and result["identical"]
    simulated = json.loads(compared.read_text())["estimators"]
    for name in ("ekf", "ekf13_published"):
        assert result["errors"][name]["attitude_rmse_rad"] == pytest.approx(
            simulated[name]["attitude_rmse_rad"], rel=1e-9
        )
    assert (
        result["errors"]["ekf"]["attitude_rmse_rad"]
        < result["errors"]["ekf13_published"]["attitude_rmse_rad"]
    )


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.999])
def test_a_truncated_log_replays_up_to_the_cut(root, tmp_path, keep):
    log = simulate(root, tmp_path / "run.lcm")
    whole = log.read_bytes()
    log.write_bytes(whole[: max(7000, int(keep * len(whole)))])
    ended = equipoise_run(root, "replay", log, "--json", "-")
    if keep == 0.0:
        assert ended.returncode == 2 and str(log) in ended.stderr
        return
    result = json.loads(ended.stdout)
    assert ended.returncode == 0 and result["identical"]
    channel, data = struct.unpack(">ii", whole[20:28])
    configuration = 28 + channel + data  # bytes of the first event
    assert result["ticks"] >= (keep - configuration / len(whole)) * 1200 - 1


def test_what_is_no_log_is_refused(root, tmp_path):
    (tmp_path / "a.lcm").write_bytes(b"\xed\xa1\xda\x01" * 100)
    for path in (tmp_path / "a.lcm", tmp_path / "none.lcm", root / "config/mbbr.toml"):
        ended = equipoise_run(root, "replay", path)
        assert ended.returncode == 2
        assert ended.stderr.startswith(f"equipoise: {path}: ") and ended.stderr.count("\n") == 1


def test_a_large_log_goes_on_in_further_files_and_replays_as_one(root, tmp_path):
    process, connection = start_lockstep(root, tmp_path, "--log-max-mb", "1")
    robot = Robot(0.0)
    with connection:
        for step in range(2000):
            message = robot.sensors(step)
            message.last = step == 1999
            connection.send(message.encode())
            motors = equipoise.lockstep_motors_t.decode(connection.recv(512))
            robot.advance(np.array(motors.duty[:3]), motors.enable)
    process.wait(timeout=30)
    parts = sorted(tmp_path.glob("run*.lcm"))
    assert [part.name for part in parts] == ["run.0001.lcm", "run.0002.lcm", "run.lcm"]
    assert all(read_log(part)["EQUIPOISE_RUN"][0].robot == "mbbr" for part in parts)
    status, result = replay(root, tmp_path / "run.lcm")
    assert status == 0 and result["ticks"] == 2000 and result["identical"]
    whole = read_log(tmp_path / "run.lcm")
    assert whole.notes == []
    assert whole["EQUIPOISE_SENSORS"]["tick"].tolist() == list(range(2000))
    for kind in ("csv", "mcap"):
        assert "2000 ticks" in equipoise_run(root, "convert", tmp_path / "run.lcm", "--to", kind).stdout


def start_again(root, log, *arguments):
    """A run that ends after five steps, in a process of its own."""
    process, connection = start_lockstep(root, log.parent, *arguments)
    with connection:
        message = Robot(0.0).sensors(0)
        for step in range(5):
            message.step, message.t_s, message.last = step, 0.005 * step, step == 4
            connection.send(message.encode())
            connection.recv(512)
    process.wait(timeout=30)


def test_a_new_start_keeps_the_last_log(root, tmp_path):
    log = tmp_path / "run.lcm"
    start_again(root, log)
    first = log.read_bytes()
    part = (
        first[:4] + (1_000_000).to_bytes(8, "big") + first[12:]
    )  # its events go on: as if it had been rotated
    (tmp_path / "run.0001.lcm").write_bytes(part)
    start_again(root, log)
    kept = sorted(path.name for path in tmp_path.glob("run.*Z*.lcm"))
    assert len(kept) == 2 and all(re.fullmatch(r"run\.\d{8}T\d{6}Z(\.0001)?\.lcm", name) for name in kept)
    assert [(tmp_path / name).read_bytes() for name in kept] == [part, first]
    assert len(read_log(log)["EQUIPOISE_SENSORS"]) == 5  # not what was kept


def test_a_log_that_is_being_written_is_not_taken(root, tmp_path):
    process, connection = start_lockstep(root, tmp_path)
    with connection:
        message = Robot(0.0).sensors(0)
        connection.send(message.encode())
        connection.recv(512)
        ended = equipoise_run(
            root, "sim", "--config", root / "config/mbbr.toml", "--log", tmp_path / "run.lcm"
        )
        assert ended.returncode != 0
        assert "another process is writing it" in ended.stderr
    process.wait(timeout=30)
    assert len(read_log(tmp_path / "run.lcm")["EQUIPOISE_SENSORS"]) == 1


def test_without_a_log_nothing_is_written(root, tmp_path):
    command = [root / "build/host/equipoise", "sim", "--config", root / "config/mbbr.toml", "--log", "off"]
    ended = subprocess.run(
        [*map(str, command), "--duration-s", "2", "--telemetry", "off"], cwd=tmp_path, capture_output=True
    )
    assert ended.returncode == 0, ended.stderr
    assert list(tmp_path.iterdir()) == []


def flat(channel, records):
    """Column -> values, as convert names them."""
    for field in records.dtype.names:
        if field in ("utime", "tick"):
            continue
        values = records[field]
        if values.ndim == 1:
            yield f"{channel}.{field}", values
        else:
            yield from ((f"{channel}.{field}_{i}", column) for i, column in enumerate(values.T))


@pytest.fixture(scope="module")
def compared_log(root, tmp_path_factory):
    """Of a run with every estimator; its loop's times are made up, for simulated time takes none."""
    log = simulate(root, tmp_path_factory.mktemp("compared") / "run.lcm", "--compare", seconds=2)

    def times(message):
        message.wake_late_ns, message.compute_ns, message.overruns = 1234567890123, 4321, 7

    for tick in (0, 57, 399):
        rewrite(log, "EQUIPOISE_TIMING", tick, times)
    return log


def columns_of(log, without=("EQUIPOISE_TIMING_HISTOGRAM",)):
    columns = {}
    for channel, records in read_log(log).items():
        if records.dtype.names and channel not in without:
            columns |= dict(flat(channel.removeprefix("EQUIPOISE_").lower(), records))
    return columns


def test_csv_holds_every_number_of_the_log(root, tmp_path, compared_log):
    out = tmp_path / "run.csv"
    assert equipoise_run(root, "convert", compared_log, "--to", "csv", "--out", out).returncode == 0
    rows = list(csv.DictReader(out.open()))
    once = ("EQUIPOISE_TIMING_HISTOGRAM", "EQUIPOISE_VERDICT")
    expected = columns_of(compared_log, without=once)
    assert [int(row["tick"]) for row in rows] == list(range(400))
    assert set(rows[0]) == {"t_s", "tick", *expected}
    assert {"timing.compute_ns", "state_ekf13.theta_rad_0", "sensors.imu_temperature_degC"} < set(expected)
    for column, values in expected.items():
        assert [float(row[column]) for row in rows] == values.tolist(), column


def test_mcap_holds_every_number_of_the_log(root, tmp_path, compared_log):
    out = tmp_path / "run.mcap"
    assert equipoise_run(root, "convert", compared_log, "--to", "mcap", "--out", out).returncode == 0
    expected = columns_of(compared_log)
    utime = read_log(compared_log)["EQUIPOISE_STATE"]["utime"].tolist()
    found = {column: [] for column in expected}
    with out.open("rb") as stream:
        for schema, channel, message in mcap.reader.make_reader(stream, validate_crcs=True).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            fields = json.loads(message.data)
            assert message.log_time == 1000 * utime[fields.pop("tick")]
            for field, value in fields.items():
                found[f"{channel.topic.removeprefix('equipoise/')}.{field}"].append(value)
    shown = {column: [None if v != v else v for v in values.tolist()] for column, values in expected.items()}
    assert len(shown["verdict.ended"]) == 1
    assert found == shown


def test_mcap_can_be_sought_in(root, tmp_path, compared_log):
    out = tmp_path / "run.mcap"
    equipoise_run(root, "convert", compared_log, "--to", "mcap", "--out", out)
    log = read_log(compared_log)
    utime = log["EQUIPOISE_STATE"]["utime"].tolist()
    with out.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        counts = {
            summary.channels[number].topic: count
            for number, count in summary.statistics.channel_message_counts.items()
        }
        names = {channel for channel in log if channel != "EQUIPOISE_RUN"}
        assert counts == {
            "equipoise/" + channel.removeprefix("EQUIPOISE_").lower(): len(log[channel]) for channel in names
        }
        assert summary.statistics.message_count == sum(counts.values())
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) > 1
        assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
        assert all(len(index.message_index_offsets) > 0 for index in summary.chunk_indexes)
        (about,) = reader.iter_metadata()
        assert about.metadata["robot"] == "mbbr" and "[robot]" in about.metadata["config_toml"]
        part = list(
            reader.iter_messages(
                ["equipoise/state"], starting_at=1000 * utime[199], ending_before=1000 * utime[219]
            )
        )
    assert [json.loads(message.data)["tick"] for _, _, message in part] == list(range(199, 219))


def test_the_foxglove_layout_shows_what_is_there(root, tmp_path, compared_log):
    out = tmp_path / "run.mcap"
    equipoise_run(root, "convert", compared_log, "--to", "mcap", "--out", out)
    with out.open("rb") as stream:
        messages = mcap.reader.make_reader(stream).iter_messages()
        there = {channel.topic: set(json.loads(message.data)) for _, channel, message in messages}
    layout = json.loads((root / "config/foxglove-layout.json").read_text())

    def panels(part):
        return {part} if isinstance(part, str) else panels(part["first"]) | panels(part["second"])

    assert panels(layout["layout"]) == set(layout["configById"])
    shown = [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", [])]
    assert len(shown) > 10
    for path in shown:
        topic, field = path.split(".", 1)
        assert field in there[topic], path
    (raw,) = (panel["topicPath"] for panel in layout["configById"].values() if "topicPath" in panel)
    assert raw in there


def test_convert_says_what_it_cannot_do(root, tmp_path):
    for arguments, complaint in [
        ([tmp_path / "none.lcm", "--to", "csv"], "none.lcm: cannot be read"),
        ([tmp_path / "none.lcm", "--to", "xls"], "--to"),
    ]:
        ended = equipoise_run(root, "convert", *arguments)
        assert ended.returncode == 2 and complaint in ended.stderr
