"""Another robot's MJCF or URDF in MuJoCo, balanced by the firmware with a configuration alone.

Motors are those of the configuration's [motor], or its torque on a joint that has damping of its own; joints
that are no wheel are locked. Before the first step the wheels' axes are compared with the configuration.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from . import mujoco_client
from .entry import leave
from .foreign_log import configuration, geometry
from .lockstep_client import DT
from .paths import UserError, binary, import_lcm_types

AXES = {"x": 0, "y": 1, "z": 2}


def signed(name: str) -> tuple[float, str]:
    return (-1.0, name[1:]) if name.startswith("-") else (1.0, name)


def compiled(path: Path, described: dict[str, Any]) -> Any:
    """The model with free base, locked joints and a floor."""
    mujoco = mujoco_client.import_mujoco()
    try:
        if path.suffix == ".urdf":  # MuJoCo would look for its pictures and merge its base into the world
            text = re.sub(r"<visual>.*?</visual>", "", path.read_text(), flags=re.S)
            compiler = '<mujoco><compiler fusestatic="false" balanceinertia="true" boundmass="1e-6" '
            compiler += 'boundinertia="1e-9"/></mujoco>'
            spec = mujoco.MjSpec.from_string(re.sub(r"(<robot[^>]*>)", rf"\1{compiler}", text, count=1))
        else:
            spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise UserError(f"{path}: MuJoCo does not read it: {error}") from None
    wheels = [signed(name)[1] for name in described["wheels"]]
    names = [joint.name for joint in spec.joints]
    for name in wheels:
        if name not in names:
            raise UserError(f"{path}: has no joint {name}; it has {', '.join(names)}")
    base = spec.body(described["base"])
    if base is None:
        raise UserError(f"{path}: has no body {described['base']}")
    for joint in list(spec.joints):
        if joint.type != mujoco.mjtJoint.mjJNT_FREE and joint.name not in wheels:
            spec.delete(joint)
    if not any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in base.joints):
        base.add_freejoint()
    if "floor_m" in described:
        height = [0, 0, described["floor_m"]]
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1], pos=height)
    base.add_site(name="equipoise_imu")
    for kind in ("ACCELEROMETER", "GYRO"):
        spec.add_sensor(
            name=f"equipoise_{kind}",
            type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname="equipoise_imu",
        )
    spec.option.timestep = DT / np.ceil(DT / spec.option.timestep)
    return spec.compile()


class Robot(mujoco_client.Robot):
    """As mujoco_client.balance wants it."""

    def __init__(self, path: Path, described: dict[str, Any], config: dict[str, Any], tilt_rad: float):
        self.mujoco = mujoco_client.import_mujoco()
        self.model = compiled(path, described)
        self.step_s = self.model.opt.timestep
        self.data = self.mujoco.MjData(self.model)
        self.joints = [(sign, self.model.joint(name)) for sign, name in map(signed, described["wheels"])]
        self.base = self.model.body(described["base"])
        self.position = self.model.jnt_qposadr[self.base.jntadr[0]]
        self.velocity = self.model.jnt_dofadr[self.base.jntadr[0]]
        self.R_OB = np.zeros((3, 3))  # rows: our body's axes in the base's
        for row, axis in enumerate(described["axes"]):
            sign, name = signed(axis)
            self.R_OB[row, AXES[name]] = sign
        motor = config["motor"]
        self.volts, self.resistance = motor["nominal_V"], motor["resistance_ohm"]
        self.k = motor["torque_constant_N_m_A"]
        self.delays = config["chain"]["gyro_delay_s"], config["chain"]["accel_delay_s"]
        self.held = True
        about = self.R_OB.T @ [1.0, 0.0, 0.0]
        self.upright = np.array([np.cos(tilt_rad / 2), *(np.sin(tilt_rad / 2) * about)])
        free = [j for j in map(self.model.joint, range(self.model.njnt)) if j.type[0] == 0]
        self.free = [(j.qposadr[0], j.dofadr[0], j.qpos0[:7].copy()) for j in free]
        # Pairs that slip one way do so along their capsule, as OpenBallBot-RL's mujoco_fix.patch has it.
        pairs = [m for m in range(self.model.npair) if len(set(self.model.pair_friction[m][:2])) > 1]
        geoms = {int(g) for m in pairs for g in (self.model.pair_geom1[m], self.model.pair_geom2[m])}
        capsule = int(self.mujoco.mjtGeom.mjGEOM_CAPSULE)
        self.rollers = {g for g in geoms if self.model.geom_type[g] == capsule}
        self.hold()
        self.mujoco.mj_forward(self.model, self.data)
        record = (np.zeros(3), self.R_OB @ self.R_WB().T @ [0.0, 0.0, 9.81])
        self.past = deque([record] * 64, maxlen=64)  # newest first

    def hold(self) -> None:
        """Base, and ball, sink to the floor and do nothing else."""
        for p, v, start in self.free:
            self.data.qpos[p : p + 2], self.data.qpos[p + 3 : p + 7] = start[:2], start[3:]
            self.data.qvel[v : v + 2] = self.data.qvel[v + 3 : v + 6] = 0.0
        self.data.qpos[self.position + 3 : self.position + 7] = self.upright

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Columns: where our wheels are and the axes about which they turn, body axes, upright."""
        into = self.R_OB @ self.R_WB().T
        here = self.data.xpos[self.base.id]
        places = [into @ (self.data.xanchor[joint.id] - here) for _, joint in self.joints]
        turns = [sign * into @ self.data.xaxis[joint.id] for sign, joint in self.joints]
        return np.array(places).T, np.array(turns).T

    def R_WB(self) -> np.ndarray:
        return self.data.xmat[self.base.id].reshape(3, 3)

    def speed_m_s(self) -> float:
        return float(np.hypot(*self.data.qvel[self.velocity : self.velocity + 2]))

    def yaw_rate_rad_s(self) -> float:
        return float((self.R_WB() @ self.data.qvel[self.velocity + 3 : self.velocity + 6])[2])

    def advance(self, duty: np.ndarray, enabled: bool) -> None:
        self.held = self.held and not enabled
        for _ in range(round(DT / self.step_s)):
            for i, (sign, joint) in enumerate(self.joints):
                at = joint.dofadr[0]
                back = 0.0 if joint.damping[0] > 0.0 else self.k * sign * self.data.qvel[at]
                torque = self.k / self.resistance * (duty[i] * self.volts - back) if enabled else 0.0
                self.data.qfrc_applied[at] = sign * torque
            self.step()
            if self.held:
                self.hold()
            gyro, force = self.data.sensor("equipoise_GYRO"), self.data.sensor("equipoise_ACCELEROMETER")
            at_rest = self.R_WB().T @ [0.0, 0.0, 9.81]
            self.past.appendleft(
                (
                    self.R_OB @ gyro.data if not self.held else np.zeros(3),
                    self.R_OB @ (at_rest if self.held else force.data),
                )
            )

    def step(self) -> None:
        """mj_step with the Euler integrator; contacts that slip along a capsule are aligned with it."""
        m, d, lib = self.model, self.data, self.mujoco
        if not self.rollers:
            lib.mj_step(m, d)
            return
        lib.mj_kinematics(m, d)
        lib.mj_comPos(m, d)
        lib.mj_makeM(m, d)
        lib.mj_factorM(m, d)
        lib.mj_collision(m, d)
        for contact in d.contact:
            if contact.friction[0] == contact.friction[1]:
                continue
            capsule = next((g for g in contact.geom if g in self.rollers), None)
            if capsule is None:
                continue
            normal = contact.frame[:3]
            along = d.geom_xmat[capsule].reshape(3, 3)[:, 2]
            along = along - (along @ normal) * normal
            along = along / np.linalg.norm(along)
            contact.frame[3:] = [*along, *np.cross(normal, along)]
        lib.mj_makeConstraint(m, d)
        lib.mj_island(m, d)
        lib.mj_projectConstraint(m, d)
        lib.mj_sensorPos(m, d)
        lib.mj_fwdVelocity(m, d)
        lib.mj_sensorVel(m, d)
        lib.mj_fwdActuation(m, d)
        lib.mj_fwdAcceleration(m, d)
        lib.mj_fwdConstraint(m, d)
        lib.mj_sensorAcc(m, d)
        lib.mj_Euler(m, d)

    def sensors(self, step: int) -> Any:
        message = import_lcm_types().lockstep_sensors_t()
        message.step, message.t_s, message.battery_V = step, step * DT, self.volts
        message.gyro_B_rad_s = self._late(0, self.delays[0]).tolist()
        message.specific_force_B_m_s2 = self._late(1, self.delays[1]).tolist()
        angles = [float(sign * self.data.qpos[joint.qposadr[0]]) for sign, joint in self.joints]
        message.wheel_angle_rad = [*angles, *[0.0] * (4 - len(angles))]
        return message


def mistake(robot: Robot, config: dict[str, Any]) -> str:
    """How the model's wheels are other than the configuration's; empty: they are not."""
    places, turns = robot.axes()
    r = config["robot"]
    if r["type"] == "mip":
        if not places[0, 0] < 0.0 < places[0, 1]:
            return "the first wheel is not the right one: their order is exchanged"
        for i in range(2):
            if turns[0, i] < 0.0:
                return f"the sign of wheel {i + 1} is flipped: turning forwards it counts backwards"
        return ""
    # A wheel turns against the ball that it rolls on; the configured axes are the ball's.
    return str(geometry(r, -turns)["mistake"]).removeprefix(": ")


def run(model: Path, map_file: Path, given: argparse.Namespace) -> dict[str, Any]:
    try:
        described = tomllib.loads(map_file.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise UserError(f"{map_file}: {error}") from None
    path = map_file.parent / described["robot"]
    config = configuration(path, given.set)
    robot = Robot(model, described, config, given.tilt_rad)
    wrong = mistake(robot, config)
    if wrong:
        raise UserError(f"{map_file}: wheels do not agree with {model}: {wrong}; not armed")
    with tempfile.TemporaryDirectory() as folder:
        socket = Path(folder) / "io.sock"
        command = [
            str(binary()),
            "run",
            "--config",
            str(path),
            "--backend",
            "lockstep",
            "--socket",
            str(socket),
        ]
        command += ["--log", "off", "--telemetry", "off", "--timeout-s", "10"]
        command += ["--drive-mps", str(given.drive_mps), "--yaw-hz", str(given.yaw_hz)]
        for setting in ("motor.bridge=drive_brake", "friction.compensation=0.0", *given.set):
            command += ["--set", setting]
        if "controller" in described:
            command += ["--controller", described["controller"]]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as firmware:
            result = mujoco_client.balance(str(socket), given.duration_s, robot)
            _, said = firmware.communicate(timeout=60)
    return result | {"said": said.strip().splitlines()[-1:] if result["ended"] != "finished" else []}


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/lab model", description=__doc__)
    parser.add_argument("model", type=Path, help="MJCF or URDF, beside the files that it names")
    parser.add_argument("--map", type=Path, required=True, help="config/real/models has examples")
    parser.add_argument("--drive-mps", type=float, default=0.2)
    parser.add_argument("--yaw-hz", type=float, default=0.0)
    parser.add_argument("--duration-s", type=float, default=20.0)
    parser.add_argument("--tilt-rad", type=float, default=0.0, help="at the start, about body x")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="of the configuration"
    )
    parser.add_argument("--json", action="store_true", help="one object on stdout")
    given = parser.parse_args()
    try:
        result = run(given.model, given.map, given)
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if given.json:
        json.dump(result, sys.stdout)
    else:
        print(
            f"{result['ended']} after {result['time_s']:.1f} s, speed {result['speed_m_s']:.4f} m/s, yaw "
            f"{result['yaw_hz']:+.3f} Hz",
            *result["said"],
        )
    return 0 if result["upright"] and result["ended"] == "finished" else 1


if __name__ == "__main__":
    leave(main)
