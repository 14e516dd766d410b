"""Mocap analysis on synthetic captures whose offsets are known."""

import numpy as np
import pytest
from equipoise_tools import mocap
from equipoise_tools.paths import UserError
from scipy.spatial.transform import Rotation, Slerp

LEVER_M = np.array([0.0, 0.0, 0.164])  # [T] (6.24)
OFFSET_S = 1.2345


def motion(t_s: np.ndarray) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Attitude, ball position and velocity: put upright at 1 s, then swaying, driving and turning."""
    upright = 1.0 / (1.0 + np.exp(np.clip((t_s - 1.0) / 0.02, -50, 50)))
    roll = 0.25 * upright + 0.04 * np.sin(3.1 * t_s) * (1 - upright)
    pitch = 0.05 * np.sin(4.3 * t_s + 0.4) * (1 - upright)
    yaw = 0.8 * np.clip(t_s - 2.0, 0, None)
    x, y = 0.2 * np.sin(0.9 * t_s), 0.15 * np.cos(0.7 * t_s)
    velocity = np.column_stack([0.18 * np.cos(0.9 * t_s), -0.105 * np.sin(0.7 * t_s)])
    attitude = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
    return attitude, np.column_stack([x, y, np.full_like(t_s, 0.032)]), velocity


def quaternion(r: Rotation) -> np.ndarray:
    return np.roll(r.as_quat(), 1, axis=-1)


@pytest.fixture(scope="module")
def log():
    t_s = np.arange(0, 20, 0.005)
    rng = np.random.default_rng(1)
    noise = Rotation.from_rotvec(rng.normal(0, 0.002, (t_s.size, 3)))
    return t_s, quaternion(motion(t_s)[0] * noise)


@pytest.fixture(scope="module")
def capture():
    """120 Hz, started later, markers turned on the body, the room turned about the vertical."""
    t_s = np.arange(0, 17, 1 / 120)
    attitude, ball, _ = motion(t_s + OFFSET_S - 0.8)
    room = Rotation.from_euler("Z", 40, degrees=True)
    markers = Rotation.from_euler("ZYX", [7, -4, 3], degrees=True)
    rng = np.random.default_rng(2)
    noise = Rotation.from_rotvec(rng.normal(0, 0.0005, (t_s.size, 3)))
    position = ball + attitude.apply(LEVER_M) + rng.normal(0, 1e-4, ball.shape)
    return (
        mocap.Mocap(t_s, quaternion(room * attitude * markers * noise), room.apply(position)),
        room,
        markers,
    )


def test_time_is_found_to_a_millisecond_without_knowing_axes(log, capture):
    t_log, q_log = log
    body, _, _ = capture
    # Both turn through the spike first; afterwards yaw grows, so only the start is compared.
    early_log, early = t_log < 2.0, body.t_s < 1.6
    offset = mocap.align(
        t_log[early_log],
        mocap.turned(q_log)[early_log],
        body.t_s[early],
        mocap.turned(body.quaternion)[early],
    )
    assert offset == pytest.approx(OFFSET_S - 0.8, abs=1e-3)


def test_the_spike_alone_is_good_for_the_guess(log):
    t_log, q_log = log
    assert mocap.spike(t_log, mocap.euler(q_log)[:, 0]) == pytest.approx(1.0, abs=0.02)


def test_axes_are_found_to_a_tenth_of_a_degree(log, capture):
    t_log, q_log = log
    body, room, markers = capture
    at = body.t_s + OFFSET_S - 0.8
    between = Slerp(t_log, mocap.rotation(q_log))
    left, right = mocap.mount(quaternion(between(at)), body.quaternion)
    assert np.degrees((right * markers).magnitude()) < 0.1
    assert np.degrees((left * room).magnitude()) < 0.1


def test_ball_speed_comes_out_through_lever_and_difference(capture):
    body, room, markers = capture
    attitude = room.inv() * mocap.rotation(body.quaternion) * markers.inv()
    ball = mocap.ball_position(room.inv().apply(body.position_m), attitude, LEVER_M)
    velocity = mocap.smooth(body.t_s, mocap.central_difference(body.t_s, ball)[:, :2], 30.0)
    _, _, true = motion(body.t_s + OFFSET_S - 0.8)
    settled = slice(240, -50)
    assert mocap.rmse(velocity[settled], true[settled]) < 0.01


def test_central_difference_of_a_ramp_is_its_slope():
    t_s = np.arange(0, 1, 1 / 120)
    assert mocap.central_difference(t_s, 3.0 * t_s) == pytest.approx(np.full(t_s.size, 3.0))


def test_smoothing_has_no_phase():
    t_s = np.arange(0, 20, 0.005)
    wave = np.sin(2.0 * t_s)
    smoothed = mocap.smooth(t_s, wave)
    inner = slice(400, -400)
    assert mocap.time_offset(t_s[inner], wave[inner], t_s[inner], smoothed[inner]) == pytest.approx(
        0.0, abs=1e-3
    )


def test_spectrum_has_the_line_where_and_as_high_as_it_is():
    t_s = np.arange(0, 40, 1 / 120)
    omega, amplitude = mocap.spectrum(t_s, 0.3 + 0.7 * np.sin(20.0 * t_s))
    peak = int(np.argmax(amplitude))
    assert omega[peak] == pytest.approx(20.0, abs=0.1)
    assert amplitude[peak] == pytest.approx(0.7, rel=0.1)


def test_csv_is_read_and_its_lacks_are_named(tmp_path):
    good = tmp_path / "good.csv"
    good.write_text(
        "t_s,qw,qx,qy,qz,x_m,y_m,z_m\n" + "".join(f"{i / 120},1,0,0,0,0,0,0.2\n" for i in range(20))
    )
    assert mocap.read_csv(good).position_m[3] == pytest.approx([0, 0, 0.2])
    bad = tmp_path / "bad.csv"
    bad.write_text("t_s,qw\n0,1\n1,1\n")
    with pytest.raises(UserError, match="no column qx"):
        mocap.read_csv(bad)


def test_table_names_runs_and_quantities():
    table = mocap.rmse_table(
        {"idle": {"attitude, rad": 0.017}, "spin": {"attitude, rad": 0.065, "speed": 0.19}}
    )
    assert "| idle | 0.017 | – |" in table
