"""A log as a rosbag2 folder (MCAP) with the messages of ROS 2; `equipoise convert LOG --to rosbag2`.

Axes are those of REP 103 (x forward, y left, z up) and frames those of REP 105 (odom, base_link). Stamps are
the robot's own clock. A covariance of zeros is ROS's word for unknown; the filter's is not in the log.
"""

from __future__ import annotations

import heapq
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core, models
from . import channels as ch
from ._convert import convert
from ._data import need
from .errors import UserError
from .log import Log

Array = NDArray[np.float64]
Message = tuple[int, str, Any]  # log time, topic, message
TYPES = {
    "/robot_description": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/imu/data_raw": "sensor_msgs/msg/Imu",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/battery_state": "sensor_msgs/msg/BatteryState",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/ground_truth/odom": "nav_msgs/msg/Odometry",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
LATCHED = ("/robot_description", "/tf_static")
IMU, ENCODERS, BATTERY = 1, 2, 4  # enum rio_valid
FAULT = 2  # enum ArmState
OK, WARN, ERROR = 0, 1, 2  # of DiagnosticStatus
SLOW = 20  # ticks between battery messages, a tenth of a second
AT_LEAST = 200  # ticks between diagnostics that do not change


def quaternions(theta: Array) -> Array:
    """w, x, y, z of R_WB = Rz Ry Rx."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(theta / 2).T, np.sin(theta / 2).T
    return np.stack(
        [
            cz * cy * cx + sz * sy * sx,
            cz * cy * sx - sz * sy * cx,
            cz * sy * cx + sz * cy * sx,
            sz * cy * cx - cz * sy * sx,
        ],
        axis=1,
    )


def velocity_B(robot: str, radius_m: float, state: np.ndarray) -> Array:
    """Of the centre of ball or axle, body axes."""
    phi_dot, theta, omega = state["phi_dot_rad_s"], state["theta_rad"], state["omega_B_rad_s"]
    if robot == "mbbr":
        x, y = radius_m * phi_dot[:, 1], -radius_m * phi_dot[:, 0]
    else:
        x, y = np.zeros(len(state)), -radius_m * (phi_dot[:, 0] + omega[:, 0])
    (cx, cy, _), (sx, sy, _) = np.cos(theta).T, np.sin(theta).T
    return np.stack([cy * x, cx * y + sx * sy * x, -sx * y + cx * sy * x], axis=1)


class Messages:
    """What a log says, topic by topic, each in the order of time."""

    def __init__(self, log: Log, types: dict[str, Any]) -> None:
        self.log, self.types = log, types
        self.robot: str = log.run.robot
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write(log.run.config_toml)
            file.flush()
            try:
                described, self.d = models.dimensions(file.name)
            except UserError as error:
                raise UserError(str(error).replace(file.name, f"{log.path}: configuration")) from None
        if described != self.robot:
            raise UserError(f"{log.path}: is of {self.robot}, its configuration of {described}")
        self.radius_m = models.rolling_radius_m(self.robot, self.d)
        self.R_FB = models.R_FB[self.robot]

    def make(self, name: str, *values: Any) -> Any:
        return self.types[name.replace("/", "/msg/")](*values)

    def header(self, t_ns: int, frame: str = "") -> Any:
        stamp = self.make("builtin_interfaces/Time", *divmod(t_ns, 1_000_000_000))
        return self.make("std_msgs/Header", stamp, frame)

    def vector(self, v: Array) -> Any:
        return self.make("geometry_msgs/Vector3", *v.tolist())

    def transform(self, t_ns: int, parent: str, child: str, at: Array, q_wxyz: Array) -> Any:
        transform = self.make("geometry_msgs/Transform", self.vector(at), self.quaternion(q_wxyz))
        return self.make("geometry_msgs/TransformStamped", self.header(t_ns, parent), child, transform)

    def quaternion(self, wxyz: Array) -> Any:
        w, x, y, z = wxyz.tolist()
        return self.make("geometry_msgs/Quaternion", x, y, z, w)

    def all(self) -> Iterator[Message]:
        topics = [self.sensors(), self.odometry(ch.STATE, "/odom"), self.diagnostics()]
        if ch.TRUTH in self.log:
            topics.append(self.odometry(ch.TRUTH, "/ground_truth/odom"))
        later = heapq.merge(*topics, key=lambda message: message[0])
        first = next(later)
        yield from self.latched(first[0])
        yield first
        yield from later

    def latched(self, t_ns: int) -> Iterator[Message]:
        yield t_ns, "/robot_description", self.make("std_msgs/String", models.urdf(self.robot, self.d))
        frames = [
            self.transform(t_ns, "base_link", child, at, quaternions(np.array([[0.0, 0.0, yaw]]))[0])
            for child, (at, yaw) in models.fixed_frames(self.robot, self.d).items()
        ]
        yield t_ns, "/tf_static", self.make("tf2_msgs/TFMessage", frames)

    def sensors(self) -> Iterator[Message]:
        """Only what was measured: of a sample whose IMU could not be read there is no Imu, and so on."""
        raw, z = self.log[ch.SENSORS], self.log.sensors()
        joints = [b.name for b in models.robot_bodies(self.robot, self.d) if b.joint == "hinge"]
        gyro, force = z["gyro_B_rad_s"] @ self.R_FB.T, -z["accel_B_m_s2"] @ self.R_FB.T
        times = zip((1000 * raw["utime"]).tolist(), raw["t_ns"].tolist(), raw["valid"].tolist(), strict=True)
        level, unknown, none = self.quaternion(np.eye(4)[0]), np.zeros(9), np.array([])
        no_orientation = np.array([-1.0] + [0.0] * 8)
        for i, (t_ns, sampled_ns, valid) in enumerate(times):
            if valid & IMU:
                header = self.header(sampled_ns, "imu_link")
                rates = (self.vector(gyro[i]), unknown, self.vector(force[i]), unknown)
                yield t_ns, "/imu/data_raw", self.make(
                    "sensor_msgs/Imu", header, level, no_orientation, *rates
                )
            if valid & ENCODERS:
                state = (self.header(t_ns), joints, z["wheel_angle_rad"][i], none, none)
                yield t_ns, "/joint_states", self.make("sensor_msgs/JointState", *state)
            if valid & BATTERY and i % SLOW == 0:
                yield t_ns, "/battery_state", self.battery(t_ns, float(z["battery_V"][i]))

    def battery(self, t_ns: int, volts: float) -> Any:
        """BatteryState's NaN: not measured; its zeros: state, health and chemistry unknown."""
        nan = math.nan
        measured = (self.header(t_ns), volts, nan, nan, nan, nan, nan, nan, 0, 0, 0, True)
        none = np.array([], np.float32)
        return self.make("sensor_msgs/BatteryState", *measured, none, none, "", "")

    def odometry(self, channel: str, topic: str) -> Iterator[Message]:
        state = self.log[channel]
        wxyz = quaternions(state["theta_rad"])
        wxyz[:, 1:] = wxyz[:, 1:] @ self.R_FB.T
        height = np.full((len(state), 1), self.radius_m)
        at = np.hstack([state["position_W_m"], height]) @ self.R_FB.T
        linear = velocity_B(self.robot, self.radius_m, state) @ self.R_FB.T
        angular = state["omega_B_rad_s"] @ self.R_FB.T
        unknown = np.zeros(36)
        for i, t_ns in enumerate((1000 * state["utime"]).tolist()):
            point = self.make("geometry_msgs/Point", *at[i].tolist())
            pose = self.make("geometry_msgs/Pose", point, self.quaternion(wxyz[i]))
            twist = self.make("geometry_msgs/Twist", self.vector(linear[i]), self.vector(angular[i]))
            both = (
                self.make("geometry_msgs/PoseWithCovariance", pose, unknown),
                self.make("geometry_msgs/TwistWithCovariance", twist, unknown),
            )
            header = self.header(t_ns, "odom")
            yield t_ns, topic, self.make("nav_msgs/Odometry", header, "base_link", *both)
            if channel == ch.STATE:
                frame = self.transform(t_ns, "odom", "base_link", at[i], wxyz[i])
                yield t_ns, "/tf", self.make("tf2_msgs/TFMessage", [frame])

    def diagnostics(self) -> Iterator[Message]:
        """At every change, and once a second."""
        said, since = None, AT_LEAST
        names = ("arm_state", "reasons", "inhibit", "degraded", "sensor_health")
        health = self.log[ch.HEALTH]
        rows = zip(*(health[name].tolist() for name in ("utime", *names)), strict=True)
        for utime, *now in rows:
            since += 1
            if now == said and since < AT_LEAST:
                continue
            said, since = now, 0
            armed, reasons, inhibit, degraded, sensors = now
            why = _core.reason_names(reasons | inhibit)
            without = _core.degraded_names(degraded)
            levels = (
                ERROR if armed == FAULT else WARN if why else OK,
                WARN if without or sensors else OK,
            )
            words = (", ".join(why) or "motors may run", ", ".join(without) or "all sensors used")
            values = (("arm_state", armed), ("reasons", reasons)), (("sensor_health", sensors),)
            statuses = [
                self.make(
                    "diagnostic_msgs/DiagnosticStatus",
                    level,
                    f"equipoise: {name}",
                    text,
                    self.robot,
                    [self.make("diagnostic_msgs/KeyValue", key, str(value)) for key, value in pairs],
                )
                for level, name, text, pairs in zip(levels, ("motors", "sensors"), words, values, strict=True)
            ]
            array = self.make("diagnostic_msgs/DiagnosticArray", self.header(1000 * utime), statuses)
            yield 1000 * utime, "/diagnostics", array


def write(log: Log, folder: str | Path) -> dict[str, int]:
    """Makes the folder; messages by topic."""
    need("rosbags", "ros")
    from rosbags import interfaces as qos
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    if Path(folder).exists():
        raise UserError(f"{folder}: exists; choose another --out or remove it")
    store = get_typestore(Stores.ROS2_HUMBLE)
    for_ever = qos.QosTime(9223372036, 854775807)
    kept = qos.Qos(
        qos.QosHistory.KEEP_LAST,
        1,
        qos.QosReliability.RELIABLE,
        qos.QosDurability.TRANSIENT_LOCAL,
        for_ever,
        for_ever,
        qos.QosLiveliness.AUTOMATIC,
        for_ever,
        False,
    )
    counts = dict.fromkeys(TYPES, 0)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP) as bag:
        connections = {
            topic: bag.add_connection(
                topic, kind, typestore=store, offered_qos_profiles=[kept] if topic in LATCHED else []
            )
            for topic, kind in TYPES.items()
            if topic != "/ground_truth/odom" or ch.TRUTH in log
        }
        for t_ns, topic, message in Messages(log, store.types).all():
            bag.write(connections[topic], t_ns, store.serialize_cdr(message, TYPES[topic]))
            counts[topic] += 1
    return counts


def main(arguments: list[str] | None = None) -> int:
    return convert("rosbag2", __doc__, write, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
