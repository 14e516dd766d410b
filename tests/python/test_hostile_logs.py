"""Logs that somebody has made up: a converter says in a line what is wrong and leaves nothing behind; the
cockpit, whose page a failure would take the control from, goes on."""

import json
import math

import pytest

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
from driven import equipoise, every_float, rewritten
from equipoise_robot import lerobot, mcap, rosbag2
from equipoise_tools import report
from equipoise_tools.cockpit.playback import Playback


def every(field, value):
    """In each message that has it."""

    def change(message):
        if hasattr(message, field):
            setattr(message, field, value(getattr(message, field)) if callable(value) else value)

    return change


def nothing(message):
    pass


def without(field):
    return lambda message: not hasattr(message, field)


CHANGES = {
    "no numbers": (every_float(math.nan), nothing),
    "large numbers": (every_float(-1e308), nothing),
    "no time": (every("utime", 0), nothing),
    "the end of time": (every("utime", 2**63 - 1), nothing),
    "ticks backwards": (every("tick", lambda tick: 10**6 - tick), nothing),
    "no motors": (every("motors", 0), nothing),
    "less than none": (every("motors", -1), nothing),
    "a billion motors": (every("motors", 10**9), nothing),
    "unknown state": (every("arm_state", 99), nothing),
    "every reason": (every("reasons", -1), nothing),
    "no sensors": (without("gyro_counts"), nothing),
    "no health": (without("arm_state"), nothing),
    "no state": (without("phi_dot_rad_s"), nothing),
    "nothing but its description": (lambda message: False, nothing),
    "another robot": (nothing, every("robot", lambda name: "mip" if name == "mbbr" else "mbbr")),
    "no robot": (nothing, every("robot", "../x")),
    "no configuration": (nothing, every("config_toml", "")),
    "half a configuration": (nothing, every("config_toml", "a = [")),
}


@pytest.fixture(params=CHANGES)
def hostile(request, tmp_path, log):
    return rewritten(tmp_path / "hostile.lcm", log, *CHANGES[request.param])


@pytest.mark.filterwarnings("ignore")  # of NumPy about such numbers
@pytest.mark.parametrize(
    "converter, library", [(rosbag2, "rosbags"), (lerobot, "pyarrow"), (mcap, "mcap.writer")]
)
def test_are_converted_or_refused_in_one_line(converter, library, hostile, tmp_path, capsys):
    pytest.importorskip(library, reason="tools/requirements-optional.txt")
    out = tmp_path / "out"
    status = converter.main([str(hostile), "--out", str(out)])
    said = capsys.readouterr().err
    assert out.exists() == (status == 0)
    if status:
        assert status == 2 and said.startswith(f"error: {hostile}: ") and said.count("\n") == 1
        assert "/tmp" not in said.replace(str(hostile), "")


@pytest.mark.filterwarnings("ignore")
def test_are_reported_or_refused(hostile, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(report, "picture_of", lambda run: b"")
    if report.main([str(hostile), "--out", str(tmp_path)]):
        said = capsys.readouterr().err
        assert said.startswith(f"error: {hostile}: ") and said.count("\n") == 1


@pytest.mark.parametrize("beside", [[], ["--shadow"]])
def test_are_replayed_or_refused(root, hostile, beside):
    assert equipoise(root, "replay", hostile, *beside).returncode in (0, 1, 2)


@pytest.mark.filterwarnings("ignore")
def test_are_played_or_refused(hostile):
    try:
        played = Playback(hostile)
        described = played.describe()
        frames = played.seek(played.first_s)
        played.playing = True
        played.advance(0.1)
    except (ArithmeticError, LookupError, TypeError, ValueError):  # what the page's handler answers
        return
    json.dumps([described, played.state()])
    assert frames
