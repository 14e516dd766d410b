"""read_log: all of an intact log, the intact part of a damaged one, and clear words about the rest."""

import struct
import subprocess
import sys
import time

import equipoise
import numpy as np
import pytest
from equipoise_robot.lcm_types import message_types
from equipoise_robot.log import read_log
from equipoise_tools.paths import UserError

import lcm


def small_log(path, ticks=20, more=()):
    """States of consecutive ticks, then `more` (channel, bytes) pairs."""
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for tick in range(ticks):
        state = equipoise.state_t()
        state.utime, state.tick = 1_000_000 + 5000 * tick, tick
        state.theta_rad = [0.1 * tick, 0.2, 0.3]
        log.write_event(state.utime, "EQUIPOISE_STATE", state.encode())
    for channel, data in more:
        log.write_event(2_000_000, channel, data)
    log.close()
    return path


def event_bytes(path, ticks):
    size = path.stat().st_size
    assert size % ticks == 0
    return size // ticks


def test_every_type_has_the_layout_that_the_generated_code_encodes():
    for kind in message_types().values():
        if kind.layout is not None:
            message = getattr(equipoise, kind.name)()
            for name in message.__slots__:  # lcm-gen starts byte arrays as text, which it cannot encode
                if isinstance(getattr(message, name), str):
                    setattr(message, name, bytes(kind.layout[name].itemsize))
            assert len(message.encode()) == 8 + kind.layout.itemsize, kind.name
    assert {"sensors_t", "command_t", "state_t", "motors_t", "health_t", "timing_t", "run_t"} <= {
        kind.name for kind in message_types().values()
    }


def test_an_intact_log_is_read_whole(tmp_path):
    log = read_log(small_log(tmp_path / "a.lcm"))
    state = log["EQUIPOISE_STATE"]
    assert log.notes == []
    assert state["tick"].tolist() == list(range(20))
    assert state["theta_rad"].shape == (20, 3)
    np.testing.assert_array_equal(state["theta_rad"][:, 0], 0.1 * np.arange(20))
    np.testing.assert_allclose(log.seconds("EQUIPOISE_STATE"), 0.005 * np.arange(20))
    assert state["theta_rad"].dtype.isnative


def test_time_starts_at_the_first_sample_not_at_the_description_of_the_run(tmp_path):
    log = read_log(small_log(tmp_path / "a.lcm", more=[("EQUIPOISE_RUN", equipoise.run_t().encode())]))
    assert log["EQUIPOISE_RUN"][0].utime == 0
    assert log.seconds("EQUIPOISE_STATE")[0] == 0.0
    assert log.duration_s == pytest.approx(19 * 0.005)


def test_values_agree_with_the_generated_decoder(known_log):
    log = read_log(known_log)
    rows = {}
    for event in lcm.EventLog(str(known_log)):
        i = rows[event.channel] = rows.get(event.channel, -1) + 1
        if i != 1234 or event.channel == "EQUIPOISE_RUN":
            continue
        record = log[event.channel][i]
        decoded = message_types()[event.data[:8]].decode(event.data)
        for name in record.dtype.names:
            np.testing.assert_array_equal(
                record[name], getattr(decoded, name), err_msg=f"{event.channel}.{name}"
            )
    assert {channel: records.size for channel, records in log.items()} == {c: i + 1 for c, i in rows.items()}


def test_all_parts_of_a_rotated_log_are_read_in_order(tmp_path):
    data = small_log(tmp_path / "all.lcm", ticks=60).read_bytes()
    each = len(data) // 6
    for number in (10000, 9999, 2, 1):
        begin = [None, 1, 2, 9999, 10000].index(number)
        (tmp_path / f"a.{number:04d}.lcm").write_bytes(data[begin * each : (begin + 1) * each])
    (tmp_path / "a.lcm").write_bytes(data[:each])
    (tmp_path / "a.old.lcm").write_bytes(data)  # others
    (tmp_path / "ab.0001.lcm").write_bytes(data)
    log = read_log(tmp_path / "a.lcm")
    assert log.notes == []
    assert log["EQUIPOISE_STATE"]["tick"].tolist() == list(range(50))
    (tmp_path / "a.lcm").unlink()  # space was short
    assert read_log(tmp_path / "a.lcm")["EQUIPOISE_STATE"]["tick"].tolist() == list(range(10, 50))
    with (tmp_path / "a.0002.lcm").open("ab") as part:
        part.write(b"torn")
    notes = read_log(tmp_path / "a.lcm").notes
    assert notes == [f"a.0002.lcm: cut off after {each} of {each + 4} bytes; what precedes is used"]


def test_memory_does_not_grow_with_the_log(tmp_path):
    """Reading fifty times as much takes as much memory; a hole of 1 GB between two events takes none."""
    data = small_log(tmp_path / "once.lcm", ticks=2000).read_bytes()

    def peak_MB(times, hole=0):
        path = tmp_path / f"{times}.lcm"
        with path.open("wb") as file:
            file.write(data)
            file.seek(hole, 1)
            for _ in range(times):
                file.write(data)
        program = (
            "import resource, sys; from equipoise_robot.log import read_log; log = read_log(sys.argv[1]);"
            "print(log['EQUIPOISE_STATE'].size, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)"
        )
        ran = subprocess.run(
            [sys.executable, "-c", program, path],
            env={"PYTHONPATH": ":".join(sys.path), "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        ticks, peak = map(int, ran.stdout.split())
        assert ticks == 2000 * (times + 1)
        return peak

    small = peak_MB(1)
    assert peak_MB(49) < small + 10  # 18 MB of log
    assert peak_MB(2, hole=1 << 30) < small + 10


@pytest.mark.parametrize("missing", [1, 40, 150])
def test_a_cut_off_log_is_read_up_to_the_cut(tmp_path, missing):
    path = small_log(tmp_path / "a.lcm")
    whole = event_bytes(path, 20)
    assert missing < whole
    path.write_bytes(path.read_bytes()[:-missing])
    log = read_log(path)
    assert log["EQUIPOISE_STATE"]["tick"].tolist() == list(range(19))
    assert len(log.notes) == 1
    assert f"cut off after {19 * whole} of {20 * whole - missing} bytes" in log.notes[0]


def test_a_damaged_event_is_left_out_and_reading_goes_on(tmp_path):
    path = small_log(tmp_path / "a.lcm")
    whole = event_bytes(path, 20)
    data = bytearray(path.read_bytes())
    data[5 * whole : 5 * whole + 4] = b"\0\0\0\0"  # the sync word of event 5
    struct.pack_into(">I", data, 9 * whole + 24, 0xFFFFFFFF)  # the message length of event 9
    path.write_bytes(data)
    log = read_log(path)
    assert log["EQUIPOISE_STATE"]["tick"].tolist() == [*range(5), *range(6, 9), *range(10, 20)]
    assert log.notes == [f"{whole} bytes at {n * whole} are damaged and skipped" for n in (5, 9)]


def test_foreign_messages_are_counted_not_misread(tmp_path):
    log = read_log(small_log(tmp_path / "a.lcm", more=[("OTHER", b"12345678 something else")]))
    assert list(log) == ["EQUIPOISE_STATE"]
    assert log.notes == ["channel OTHER: 1 messages of an unknown type or version are skipped"]


def test_a_message_of_wrong_length_costs_its_channel_not_the_log(tmp_path):
    torn = equipoise.state_t().encode()[:-3]
    log = read_log(small_log(tmp_path / "a.lcm", more=[("EQUIPOISE_TRUTH", torn)]))
    assert list(log) == ["EQUIPOISE_STATE"]
    assert "EQUIPOISE_TRUTH is skipped" in log.notes[0]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(b"", "is not an LCM event log"), (b"PNG and so on", "is not an LCM event log"), (None, "No such file")],
)
def test_what_is_no_log_is_refused_by_name(tmp_path, content, complaint):
    path = tmp_path / "b.lcm"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UserError, match=complaint) as error:
        read_log(path)
    assert str(path) in str(error.value)


def test_false_headers_take_no_longer_than_the_file_is_long(tmp_path):
    """Each claims 16 MB that are not there: read for each, ten times as many took a hundred times as long."""

    def took_s(count):
        path = small_log(tmp_path / "a.lcm")
        false = struct.pack(">IqqII", 0xEDA1DA01, 0, 0, 16, (1 << 24) - 1)
        with path.open("ab") as file:
            file.write(false * count)
        began = time.process_time()
        assert read_log(path)["EQUIPOISE_STATE"].size == 20
        return time.process_time() - began

    assert took_s(200_000) < 30.0 * took_s(20_000)


def test_channels_without_end_are_left_out(tmp_path):
    more = [(f"CHANNEL_{i}", equipoise.state_t().encode()) for i in range(3000)]
    log = read_log(small_log(tmp_path / "a.lcm", more=more))
    assert log["EQUIPOISE_STATE"].size == 20 and len(log) == 200
    assert "more than 200 channels: 2801 messages are skipped" in log.notes


def test_a_file_that_merely_has_the_name_of_a_part_is_none(tmp_path):
    data = small_log(tmp_path / "a.lcm").read_bytes()
    (tmp_path / "a.2024.lcm").write_bytes(data)
    (tmp_path / "a.0001.lcm").write_text("notes")
    assert read_log(tmp_path / "a.lcm")["EQUIPOISE_STATE"].size == 20
