"""The MBBR as rigid bodies that touch: body, three wheels, ball, floor, Coulomb contacts, in MuJoCo.

build/venv/bin/python tests/python/mujoco_contacts.py    # writes tests/data/oracle/mbbr_contacts.json

An ideal omniwheel is a sphere that its motor turns about the wheel's axis and that is free about the others.
Numbers: [T] Table 5.2, section 6.2.3; wheels nearly without inertia: such a sphere has more than a wheel.
"""

import json
from pathlib import Path

import mujoco
import numpy as np

G = 9.8
BODY_KG, BALL_KG, BALL_M, WHEEL_M, HEIGHT_M = 0.55, 0.15, 0.032, 0.0125, 0.1
BODY_INERTIA, BALL_INERTIA, WHEELS_INERTIA = (2.42e-3, 2.42e-3, 0.79e-3), 8.46e-5, 1e-6
LATITUDE, AZIMUTH = np.radians(60.0), np.radians(-140.0)
STALL_N_M, NO_LOAD_RAD_S = 0.0742 * 8.0 / 3.385, 8.0 / 0.0742
STEP_S, RUN_S = 2e-5, 0.06
PUSH_S = 0.05
HOLDING = 'solref="-50000 -5000" solimp="0.9 0.95 0.0001"'  # these chatter when they slide
SLIDING = 'solref="-20000 -1000" solimp="0.5 0.5 0.0001"'  # these creep when they hold
# Duties, friction coefficients of wheels and floor, contact radius, push on the body, contacts.
CASES = [
    ((0.2, -0.1, 0.1), 0.8, 0.8, 0.01, (0.0, 0.0), HOLDING),
    ((0.95, -0.8, 0.7), 0.5, 0.8, 0.01, (0.0, 0.0), SLIDING),
    ((0.9, 0.9, 0.9), 0.6, 0.6, 0.0005, (0.0, 0.0), SLIDING),
    ((0.9, 0.9, 0.9), 0.6, 0.6, 0.02, (0.0, 0.0), SLIDING),
    ((0.95, -0.8, 0.7), 0.5, 0.6, 0.002, (0.0, 0.0), SLIDING),
    ((0.3, -0.25, 0.2), 1.0, 0.15, 0.002, (0.0, 0.0), SLIDING),
    ((0.2, -0.15, 0.1), 1.0, 0.1, 0.002, (0.0, 0.0), HOLDING),
    ((0.9, 0.0, 0.0), 0.5, 0.7, 0.0025, (0.0, 0.0), SLIDING),
    ((0.05, -0.1, 0.9), 0.65, 0.8, 0.0025, (3.0, -2.0), SLIDING),
    ((0.0, 0.0, 0.0), 0.5, 0.5, 0.0025, (0.0, 4.0), HOLDING),
]


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def wheels():
    """Axes and contacts, body axes; [T] (2.3)-(2.5)."""
    tilt = np.arccos(1.0 / (np.sqrt(3.0) * np.sin(LATITUDE)))
    meridian = np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)])
    axis = np.cos(tilt) * meridian - np.sin(tilt) * np.array([0.0, 1.0, 0.0])
    contact = np.array([-np.sin(LATITUDE), 0.0, np.cos(LATITUDE)])
    turns = [turned(AZIMUTH + 2.0 * np.pi / 3.0 * i) for i in range(3)]
    return [t @ axis for t in turns], [t @ contact for t in turns]


def numbers(values):
    return " ".join(f"{value:.12g}" for value in np.atleast_1d(values))


def model(wheel_grip, floor_grip, torsion_m, contact):
    inertia = numbers([WHEELS_INERTIA * (WHEEL_M / BALL_M) ** 2] * 3)
    bodies = "".join(f"""<body name="wheel{i}" pos="{numbers((BALL_M + WHEEL_M - 2e-7) * at)}">
          <joint name="wheel{i}" type="ball"/><inertial pos="0 0 0" mass="1e-6" diaginertia="{inertia}"/>
          <geom type="sphere" size="{WHEEL_M}" contype="2" conaffinity="4" condim="3"
                friction="{wheel_grip} 0 0" {contact}/></body>""" for i, at in enumerate(wheels()[1]))
    return f"""<mujoco>
      <option timestep="{STEP_S}" gravity="0 0 -{G}" integrator="implicitfast" cone="elliptic" impratio="50"
              noslip_iterations="10" tolerance="1e-12"/>
      <worldbody>
        <geom type="plane" size="5 5 1" contype="8" conaffinity="8" condim="4"
              friction="{floor_grip} {floor_grip * torsion_m} 0" {contact}/>
        <body name="ball" pos="0 0 {BALL_M - 1e-7}"><freejoint/>
          <inertial pos="0 0 0" mass="{BALL_KG}" diaginertia="{numbers([BALL_INERTIA] * 3)}"/>
          <geom type="sphere" size="{BALL_M}" contype="12" conaffinity="10" condim="3"
                friction="0 0 0" {contact}/>
        </body>
        <body name="robot" pos="0 0 {BALL_M}"><freejoint/>
          <inertial pos="0 0 {HEIGHT_M}" mass="{BODY_KG}" diaginertia="{numbers(BODY_INERTIA)}"/>
          {bodies}</body>
      </worldbody></mujoco>"""


def run(duty, wheel_grip, floor_grip, torsion_m, push, contact):
    engine = mujoco.MjModel.from_xml_string(model(wheel_grip, floor_grip, torsion_m, contact))
    data = mujoco.MjData(engine)
    robot, ball = engine.body("robot").id, engine.body("ball").id
    joints = [engine.joint(f"wheel{i}") for i in range(3)]
    axes, _ = wheels()
    there, back, rate, torque = np.zeros(4), np.zeros(4), np.zeros(3), np.zeros(3)
    for step in range(round(RUN_S / STEP_S)):
        for axis, joint, u in zip(axes, joints, duty, strict=True):
            there[:] = data.qpos[joint.qposadr[0] : joint.qposadr[0] + 4]
            dofs = slice(joint.dofadr[0], joint.dofadr[0] + 3)
            mujoco.mju_rotVecQuat(rate, data.qvel[dofs], there)
            driven = STALL_N_M * (u + rate @ axis / NO_LOAD_RAD_S)  # a wheel turns against the ball
            mujoco.mju_negQuat(back, there)
            mujoco.mju_rotVecQuat(torque, -driven * axis, back)
            data.qfrc_applied[dofs] = torque
        pushed = step * STEP_S < PUSH_S
        data.xfrc_applied[robot, :2] = push if pushed else (0.0, 0.0)
        mujoco.mj_step(engine, data)
    R = data.xmat[robot].reshape(3, 3)
    yaw = np.arctan2(R[1, 0], R[0, 0])
    return {
        "theta": [np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]), yaw],
        "omega_B": data.qvel[9:12],
        "phi_star_dot": (turned(-yaw) @ data.xmat[ball].reshape(3, 3) @ data.qvel[3:6])[:2],
        "path_m": data.qpos[:2],
    }


def main():
    rows = []
    for case in CASES:
        duty, wheel_grip, floor_grip, torsion_m, push, _ = case
        row = {
            "duty": duty,
            "wheel_grip": wheel_grip,
            "floor_grip": floor_grip,
            "torsion_radius_m": torsion_m,
        }
        row |= {"push_W_N": push, "at_s": RUN_S}
        rows.append(row | {key: [round(float(x), 5) for x in value] for key, value in run(*case).items()})
    out = Path(__file__).resolve().parents[1] / "data/oracle/mbbr_contacts.json"
    text = ",\n".join(json.dumps(row) for row in rows)
    out.write_text(f'{{"engine": "MuJoCo {mujoco.__version__}", "rows": [\n{text}\n]}}\n')
    print(out)


if __name__ == "__main__":
    main()
