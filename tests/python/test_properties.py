"""For every command, every mounting of the sensors, every start of the encoders (hypothesis)."""

import math

import equipoise_robot as eq
import numpy as np
import pytest
from equipoise_tools.lockstep_client import Robot
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from test_lockstep import Firmware, step

TICK_S = 0.005
# Rolling radius, max_acceleration_m_s2 and the yaw acceleration that the robot's configuration allows.
LIMITS = {"mbbr": (0.032, 0.5, 2.5), "mip": (0.034, 0.2, 10.0)}
COUNTS_PER_REV = 720  # of config/mbbr.toml

# The same examples in every run; the fixtures hold nothing that an example changes.
same = settings(
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def sampled(robot, duration_s=2.0, **asked):
    """Per tick: reference of ball or wheel rate, reference of body rates, tilt, wheel or ball angle, u."""
    seen = []

    def watching(tick):
        reference, estimate = tick.reference, tick.estimate
        rows = (reference.phi_dot_rad_s, reference.omega_B_rad_s, estimate.theta_rad, estimate.phi_rad)
        seen.append([np.array(row, dtype=float) for row in (*rows, tick.u_own)])
        return tick.u_own

    run = eq.run(robot, duration_s=duration_s, fidelity="ideal", controller=watching, **asked)
    assert run.ended == "finished" and len(seen) == round(duration_s / TICK_S)
    return [np.array(column) for column in zip(*seen, strict=True)]


@pytest.mark.parametrize("robot", LIMITS)
@given(drive_mps=st.floats(-2.0, 2.0), yaw_hz=st.floats(-5.0, 5.0))
@settings(same, max_examples=15)
@example(drive_mps=2.0, yaw_hz=5.0)
@example(drive_mps=-2.0, yaw_hz=0.0)
def test_no_command_asks_for_more_than_the_governor_allows(robot, drive_mps, yaw_hz):
    radius, acceleration, yaw_acceleration = LIMITS[robot]
    rate, body, *_ = sampled(robot, drive_mps=drive_mps, yaw_hz=yaw_hz)
    speed = radius * np.linalg.norm(rate, axis=1)
    assert speed.max() <= abs(drive_mps) + 1e-9
    assert np.abs(body[:, 2]).max() <= 2.0 * math.pi * abs(yaw_hz) + 1e-9
    assert np.abs(np.diff(speed)).max() <= acceleration * TICK_S + 1e-9
    assert np.abs(np.diff(body[:, 2])).max() <= yaw_acceleration * TICK_S + 1e-9


def rotation(wxyz):
    w, x, y, z = np.array(wxyz) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


number = st.floats(-1.0, 1.0)
sign = st.sampled_from((-1, 1))


@pytest.mark.parametrize(("robot", "wheels"), [("mbbr", 3), ("mip", 2)])
@given(
    wxyz=st.tuples(number, number, number, number).filter(lambda q: np.linalg.norm(q) > 0.1),
    signs=st.lists(st.tuples(sign, sign), min_size=3, max_size=3),
)
@settings(same, max_examples=12)
@example(wxyz=(0.0, 1.0, 0.0, 0.0), signs=[(-1, -1)] * 3)  # upside down
def test_however_sensors_and_wheels_are_mounted_the_calibration_undoes_it(robot, wheels, wxyz, signs):
    asked = {"yaw_hz": 0.5, "drive_mps": 0.1}
    mounted = {
        "calibration.R_BS": np.clip(rotation(wxyz), -1.0, 1.0).ravel().tolist(),
        "calibration.encoder_sign": [encoder for encoder, _ in signs[:wheels]],
        "calibration.motor_sign": [motor for _, motor in signs[:wheels]],
    }
    for straight, turned in zip(sampled(robot, **asked), sampled(robot, set=mounted, **asked), strict=True):
        np.testing.assert_allclose(turned, straight, atol=1e-6)


def duties(root, folder, offset_counts):
    """Of half a second of a run with encoders that start at `offset_counts`."""
    folder.mkdir(exist_ok=True)
    firmware = Firmware(root, folder)
    rad = 2.0 * math.pi / COUNTS_PER_REV * offset_counts
    robot, told = Robot(0.01), []
    with firmware.connect() as connection:
        for tick in range(200):
            angles = robot.sensors(tick).wheel_angle_rad
            shifted = [angle + rad for angle in angles[:3]] + [0.0]
            motors = step(connection, robot, tick, tick == 199, wheel_angle_rad=shifted)
            told.append(motors.duty)
            robot.advance(np.array(motors.duty[:3]), motors.enable)
    status, _, complaint = firmware.end()
    assert status == 0, complaint
    return np.array(told)


def test_where_the_encoders_start_does_not_matter(root, tmp_path):
    from_zero = duties(root, tmp_path / "zero", 0)
    assert np.abs(from_zero).max() > 0.01

    @given(offset=st.integers(-(2**31), 2**31 - 1))
    @settings(same, max_examples=6)
    @example(offset=2**31 - 2)  # a 32-bit counter's end lies in the run
    def starts_at(offset):
        np.testing.assert_allclose(duties(root, tmp_path / "offset", offset), from_zero, atol=1e-5)

    starts_at()
