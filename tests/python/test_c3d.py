"""C3D motion capture against a file written here by the format's description, with a known motion."""

import contextlib
import os
import struct

import numpy as np
import pytest
from equipoise_tools import c3d
from equipoise_tools.paths import UserError
from scipy.spatial.transform import Rotation

RATE_HZ = 120.0
LAYOUT = np.array([[0.05, 0, 0], [-0.03, 0.04, 0], [-0.02, -0.04, 0.01], [0.0, 0.0, 0.06]])
LAYOUT -= LAYOUT.mean(axis=0)


def motion(frames=200):
    t = np.arange(frames) / RATE_HZ
    turn = Rotation.from_euler("ZYX", np.stack([3 * t, 0.1 * np.sin(5 * t), 0.05 * t], axis=1))
    place = np.stack([0.2 * t, 0.1 * np.cos(t) - 0.1, 0.3 + 0 * t], axis=1)
    return t, turn, place


def parameter(group, name, text=None):
    head = struct.pack("bb", len(name), group) + name.encode()
    if text is None:  # a group's definition
        return head + struct.pack("<h", 3) + b"\0"
    body = struct.pack("bBB", -1, 1, len(text)) + text.encode() + b"\0"
    return head + struct.pack("<h", 2 + len(body)) + body


def write(path, turn, place, unit="mm", floats=True, hide=()):
    scale_m = {"mm": 1e3, "m": 1.0}[unit]
    step = 0.02 if not floats else -1.0
    frames = len(place)
    points = np.stack([r.apply(LAYOUT) + p for r, p in zip(turn, place, strict=True)]) * scale_m
    values = np.zeros((frames, len(LAYOUT), 4))
    values[..., :3] = points if floats else np.round(points / step)
    for frame, marker in hide:
        values[frame, marker, 3] = -1
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, len(LAYOUT), 2, 1, frames, 0, step, 3, 1, RATE_HZ)
    parameters = b"\1\x50\1\x54" + parameter(-1, "POINT") + parameter(1, "UNITS", unit) + b"\0\0"
    analogue = np.zeros((frames, 2))
    rows = np.concatenate([values.reshape(frames, -1), analogue], axis=1)
    data = rows.astype("<f4" if floats else "<i2").tobytes()
    path.write_bytes(header.ljust(512, b"\0") + parameters.ljust(512, b"\0") + data)
    return path


@pytest.mark.parametrize(("unit", "floats"), [("mm", True), ("m", True), ("mm", False)])
def test_pose_comes_back(tmp_path, unit, floats):
    t, turn, place = motion()
    mocap = c3d.read_c3d(write(tmp_path / "a.c3d", turn, place, unit, floats))
    assert mocap.t_s == pytest.approx(t, abs=1e-6)
    assert mocap.position_m == pytest.approx(place, abs=2e-5)
    relative = Rotation.from_quat(np.roll(mocap.quaternion, -1, axis=1)) * turn[0]
    assert np.degrees((turn.inv() * relative).magnitude()).max() < 0.05


def test_hidden_markers_are_left_out_and_frames_with_too_few_dropped(tmp_path):
    t, turn, place = motion()
    hide = [(50, 0), (60, 0), (60, 1)]
    mocap = c3d.read_c3d(write(tmp_path / "a.c3d", turn, place, hide=hide))
    assert mocap.t_s.size == t.size - 1
    at = int(np.searchsorted(mocap.t_s, t[50]))
    assert mocap.position_m[at] == pytest.approx(place[50], abs=1e-5)


def test_other_files_are_refused_with_a_reason(tmp_path):
    junk = tmp_path / "junk.c3d"
    junk.write_bytes(b"\2x" * 2000)
    with pytest.raises(UserError, match="not a C3D file"):
        c3d.read_c3d(junk)
    _, turn, place = motion()
    cut = write(tmp_path / "cut.c3d", turn, place)
    cut.write_bytes(cut.read_bytes()[:2000])
    with pytest.raises(UserError, match="cut short"):
        c3d.read_c3d(cut)
    with pytest.raises(UserError, match="No such file"):
        c3d.read_c3d(tmp_path / "none.c3d")
    os.mkfifo(tmp_path / "pipe.c3d")
    with pytest.raises(UserError, match="is no file"):
        c3d.read_c3d(tmp_path / "pipe.c3d")


@pytest.mark.filterwarnings("ignore")  # of NumPy about such numbers
def test_whatever_its_header_says_it_is_read_or_refused(tmp_path):
    _, turn, place = motion(20)
    good = write(tmp_path / "a.c3d", turn, place).read_bytes()
    bad = tmp_path / "bad.c3d"
    random = np.random.default_rng(1)
    for _ in range(1500):
        changed = bytearray(good)
        for at in random.choice([*range(24), *range(512, 560)], random.integers(1, 4)):
            changed[at] = random.choice([0, 1, 127, 128, 255, random.integers(256)])
        bad.write_bytes(changed)
        with contextlib.suppress(UserError):
            c3d.read_c3d(bad)
