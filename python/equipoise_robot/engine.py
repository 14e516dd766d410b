"""MuJoCo's rigid bodies behind our motors, gears, friction and sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._data import need

Array = NDArray[np.float64]


class Engine:
    """The bodies of one robot; `inputs` and `outputs` as _core.run_in_engine has them."""

    def __init__(self, xml: str, inputs: Array, outputs: Array) -> None:
        self.mujoco = need("mujoco", "mujoco")
        self.model = self.mujoco.MjModel.from_xml_string(xml)
        self.data = self.mujoco.MjData(self.model)
        for i in range(self.model.nnumeric):
            exact = self.model.numeric(i)
            self.model.body(exact.name.removeprefix("inertia_")).inertia[:] = exact.data
        self.mujoco.mj_setConst(self.model, self.data)
        data, body = self.data, self.model.body
        self.torque, self.push, self.drag = inputs[:3], inputs[3:5], inputs[5:7]
        self.R_WB, self.gyro, self.force = outputs[:9], outputs[9:12], outputs[12:15]
        self.joint_rate, self.position, self.velocity = outputs[15:18], outputs[18:21], outputs[21:24]
        self.has_ball = self.model.nq == 11
        # Views, made once: each costs as much as what is done with it.
        self.attitude, self.ball, self.ball_rate = data.qpos[3:7], data.qpos[7:11], data.qvel[6:9]
        self.applied, self.back = data.qfrc_applied[6:9], np.zeros(4)
        self.pushed = data.xfrc_applied[body("robot").id][:2]
        rolling = [body(name).id for name in (["ball"] if self.has_ball else ["right", "left"])]
        # Neighbours.
        self.dragged, self.share = data.xfrc_applied[rolling[0] : rolling[-1] + 1, :2], 1.0 / len(rolling)
        self.seen = [
            (self.gyro, data.qvel[3:6]),
            (self.force, data.sensor("accel").data),
            (self.position, data.qpos[:3]),
            (self.velocity, data.qvel[:3]),
        ]
        if not self.has_ball:
            self.torque, self.applied = self.torque[:2], self.applied[:2]
            self.seen.append((self.joint_rate[:2], data.qvel[6:8]))

    def start(self) -> None:
        """At the attitude `R_WB`; a robot on two wheels turned about its y until both are on the floor."""
        data, lib = self.data, self.mujoco
        lib.mju_mat2Quat(self.attitude, self.R_WB)
        lib.mj_forward(self.model, data)
        if not self.has_ball:
            normal = self.R_WB.reshape(3, 3).T @ data.geom("floor").xmat[2::3]
            about_y, leant = np.zeros(4), self.attitude.copy()
            lib.mju_axisAngle2Quat(about_y, np.array([0.0, 1.0, 0.0]), np.arctan2(normal[0], normal[2]))
            lib.mju_mulQuat(self.attitude, leant, about_y)
            lib.mj_forward(self.model, data)
        self.read()

    def step(self) -> None:
        lib = self.mujoco
        if self.has_ball:  # the engine has the joint in the ball's own axes
            lib.mju_negQuat(self.back, self.ball)
            lib.mju_rotVecQuat(self.applied, self.torque, self.back)
        else:
            self.applied[:] = self.torque
        self.pushed[:] = self.push
        np.multiply(self.drag, self.share, out=self.dragged)
        lib.mj_step(self.model, self.data)
        self.read()

    def read(self) -> None:
        self.mujoco.mju_quat2Mat(self.R_WB, self.attitude)
        if self.has_ball:
            self.mujoco.mju_rotVecQuat(self.joint_rate, self.ball_rate, self.ball)
        for seen, there in self.seen:
            seen[:] = there
