"""`convert --to rosbag2`: read by rosbags and by mcap-ros2-support, and compared with the log."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

OPTIONAL = "tools/test installs tools/requirements-optional.txt"
rosbags = pytest.importorskip("rosbags", reason=OPTIONAL)
pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
import mcap.reader  # noqa: E402
from driven import equipoise  # noqa: E402
from equipoise_robot import channels as ch  # noqa: E402
from equipoise_robot.log import Log  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

FORWARD = {"mbbr": np.eye(3), "mip": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])}  # docs/symbols.md


@pytest.fixture(scope="module")
def bag(root, log):
    converted = equipoise(root, "convert", log, "--to", "rosbag2")
    assert converted.returncode == 0, converted.stderr
    return log.with_suffix(".rosbag2")


@pytest.fixture(scope="module")
def messages(bag):
    """Topic -> (log time, message) by rosbags."""
    found = {}
    with AnyReader([bag]) as reader:
        for connection, t_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((t_ns, message))
        assert {c.topic: c.msgcount for c in reader.connections} == {t: len(m) for t, m in found.items()}
    return found


def stamp(message):
    stamp = message.header.stamp
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def xyz(vectors):
    return np.array([[v.x, v.y, v.z] for v in vectors])


def turns(quaternions):
    return Rotation.from_quat(np.array([[q.x, q.y, q.z, q.w] for q in quaternions]))


def test_counts_and_stamps_are_the_logs(log, messages):
    read = Log(log)
    ticks = len(read[ch.SENSORS])
    every = {"/imu/data_raw", "/joint_states", "/odom", "/tf", "/ground_truth/odom"}
    assert {topic: len(messages[topic]) for topic in every} == dict.fromkeys(every, ticks)
    assert len(messages["/battery_state"]) == math.ceil(ticks / 20)
    assert len(messages["/robot_description"]) == len(messages["/tf_static"]) == 1
    utime_ns = (1000 * read[ch.STATE]["utime"]).tolist()
    for topic in every:
        assert [t_ns for t_ns, _ in messages[topic]] == utime_ns
    assert [stamp(m) for _, m in messages["/imu/data_raw"]] == read[ch.SENSORS]["t_ns"].tolist()
    assert [stamp(m) for _, m in messages["/odom"]] == utime_ns


def test_the_decoder_of_foxglove_reads_the_same(bag, messages):
    decoder = pytest.importorskip("mcap_ros2.decoder", reason=OPTIONAL)
    (file,) = bag.glob("*.mcap")
    found = {}
    with file.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    assert {topic: len(m) for topic, m in found.items()} == {t: len(m) for t, m in messages.items()}
    for (t_ns, here), (other_ns, there) in zip(messages["/odom"], found["/odom"], strict=True):
        assert t_ns == other_ns and stamp(here) == stamp(there)
        for part in ("position", "orientation"):
            a, b = getattr(here.pose.pose, part), getattr(there.pose.pose, part)
            assert all(getattr(a, name) == getattr(b, name) for name in ("x", "y", "z"))
    assert found["/battery_state"][0][1].voltage == messages["/battery_state"][0][1].voltage
    assert found["/robot_description"][0][1].data == messages["/robot_description"][0][1].data


def test_sensors_are_the_logs_in_ros_axes_and_units(log, robot, messages):
    z = Log(log).sensors()
    imu = [m for _, m in messages["/imu/data_raw"]]
    assert {m.header.frame_id for m in imu} == {"imu_link"}
    assert xyz(m.angular_velocity for m in imu) == pytest.approx(z["gyro_B_rad_s"] @ FORWARD[robot].T)
    force = xyz(m.linear_acceleration for m in imu)
    assert force == pytest.approx(-z["accel_B_m_s2"] @ FORWARD[robot].T)
    assert force[:, 2].mean() == pytest.approx(9.8, abs=0.1)  # at rest an accelerometer has +g upward
    assert all(m.orientation_covariance[0] == -1 for m in imu)  # none is measured
    joints = [m for _, m in messages["/joint_states"]]
    assert np.array([m.position for m in joints]) == pytest.approx(z["wheel_angle_rad"])
    volts = np.array([m.voltage for _, m in messages["/battery_state"]])
    assert volts == pytest.approx(z["battery_V"][::20], rel=1e-6)
    assert all(math.isnan(m.current) and math.isnan(m.percentage) for _, m in messages["/battery_state"])


def test_odometry_is_the_estimate_with_x_forward(log, robot, messages):
    state, forward = Log(log)[ch.STATE], FORWARD[robot]
    odom = [m for _, m in messages["/odom"]]
    assert {(m.header.frame_id, m.child_frame_id) for m in odom} == {("odom", "base_link")}
    at = xyz(m.pose.pose.position for m in odom)
    assert at[:, :2] == pytest.approx(state["position_W_m"] @ forward[:2, :2].T)
    now = turns(m.pose.pose.orientation for m in odom)
    expected = forward @ Rotation.from_euler("xyz", state["theta_rad"]).as_matrix() @ forward.T
    assert now.as_matrix() == pytest.approx(expected, abs=1e-9)
    # Twist and pose say the same: what is integrated arrives, and who drives forward has +x.
    linear, angular = xyz(m.twist.twist.linear for m in odom), xyz(m.twist.twist.angular for m in odom)
    turned = now[0]
    for w in angular[1:]:
        turned = turned * Rotation.from_rotvec(w * 0.005)
    assert (turned.inv() * now[-1]).magnitude() < 0.05
    assert at[0, :2] + 0.005 * now.apply(linear)[1:, :2].sum(axis=0) == pytest.approx(at[-1, :2], abs=0.01)
    # The eduMIP drives where it looks, the MBBR along the heading that it had at the start.
    driven = linear if robot == "mip" else now.apply(linear)
    assert driven[400:, :2].mean(axis=0) == pytest.approx([0.1, 0.0], abs=0.02)
    (tf,) = zip(*(m.transforms for _, m in messages["/tf"]), strict=True)
    assert {(t.header.frame_id, t.child_frame_id) for t in tf} == {("odom", "base_link")}
    assert np.array_equal(xyz(t.transform.translation for t in tf), at)
    truth = xyz(m.pose.pose.position for _, m in messages["/ground_truth/odom"])
    assert truth == pytest.approx(at, abs=0.05)


def test_the_robots_description_has_the_joints_and_frames(robot, messages, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy", reason=OPTIONAL)
    (_, description), (_, static) = messages["/robot_description"][0], messages["/tf_static"][0]
    path = tmp_path / "robot.urdf"
    path.write_text(description.data)
    urdf = yourdfpy.URDF.load(path)
    assert set(messages["/joint_states"][0][1].name) <= set(urdf.joint_map)
    # The ball does not spin: who turns left has wheels that turn left on it (MBBR), or the right one ahead.
    joints = messages["/joint_states"][-1][1]
    axes = [urdf.get_transform(n, "base_link")[:3, :3] @ urdf.joint_map[n].axis for n in joints.name]
    turned = joints.position - messages["/joint_states"][0][1].position
    if robot == "mbbr":
        assert turned @ np.array(axes)[:, 2] > 1.0
    else:
        assert joints.name == ["right", "left"] and turned[0] > turned[1] + 1.0
    for frame in static.transforms:
        expected = urdf.get_transform(frame.child_frame_id, frame.header.frame_id)
        assert turns([frame.transform.rotation]).as_matrix()[0] == pytest.approx(expected[:3, :3], abs=1e-6)
        assert xyz([frame.transform.translation])[0] == pytest.approx(expected[:3, 3])


def test_the_foxglove_layout_shows_what_is_there(root, messages):
    layout = json.loads((root / "config/foxglove-ros2-layout.json").read_text())["configById"]
    paths = [path["value"] for panel in layout.values() for path in panel.get("paths", [])]
    assert len(paths) > 5
    for path in paths:
        topic, *fields = path.split(".")
        value = messages[topic][0][1]
        for field in fields:
            value = getattr(value, field)
        assert isinstance(value, float), path
    named = {layout["3D!robot"]["layers"]["urdf"]["topic"], *layout["3D!robot"]["topics"]}
    assert named | {layout["DiagnosticSummary!health"]["topicToRender"]} <= set(messages)


def test_diagnostics_say_what_safety_said(log, messages):
    health = Log(log)[ch.HEALTH]
    by_time = dict(zip((1000 * health["utime"]).tolist(), health, strict=True))
    said = [(by_time[t_ns], m.status) for t_ns, m in messages["/diagnostics"]]
    assert len(said) >= 4  # once a second, and when it arms
    states = {int(row["arm_state"]) for row, _ in said}
    assert states == {0, 1}
    for row, (motors, sensors) in said:
        assert motors.values[0].value == str(row["arm_state"])
        assert motors.level == (1 if row["reasons"] or row["inhibit"] else 0)
        assert sensors.level == (1 if row["degraded"] or row["sensor_health"] else 0)


def test_a_sample_without_imu_has_no_message_and_a_fault_is_an_error(root, tmp_path):
    path = tmp_path / "run.lcm"
    run = ["run", "--backend", "sim", "--config", root / "config/mbbr.toml", "--telemetry", "off"]
    run += ["--speed", "20", "--arm", "--duration-s", "4"]
    ran = equipoise(root, *run, "--fault", "imu_off@2", "--fault", "encoder_errors@1+0.1", "--log", path)
    assert path.exists(), ran.stderr
    out = tmp_path / "bag"
    assert equipoise(root, "convert", path, "--to", "rosbag2", "--out", out).returncode == 0
    read = Log(path)
    valid = read[ch.SENSORS]["valid"]
    with AnyReader([out]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        last = [
            reader.deserialize(data, c.msgtype)
            for c, _, data in reader.messages()
            if c.topic == "/diagnostics"
        ]
    assert counts["/imu/data_raw"] == np.count_nonzero(valid & 1) < len(valid)
    assert counts["/joint_states"] == np.count_nonzero(valid & 2)
    assert last[-1].status[0].level == 2 and "imu" in last[-1].status[0].message


def test_what_is_missing_and_what_is_there_already_is_said(root, log, bag):
    again = equipoise(root, "convert", log, "--to", "rosbag2")
    assert again.returncode == 2 and f"{bag}: exists; choose another --out" in again.stderr
    program = f"""
import sys
sys.modules["rosbags"] = None
from equipoise_robot.rosbag2 import main
sys.exit(main([{str(log)!r}, "--out", {str(bag) + "2"!r}]))
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert "rosbags is not installed; in a clone: pip install '.[ros]'" in ran.stderr
