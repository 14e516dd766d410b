"""MJCF and URDF of a robot from its configuration: one list of bodies, in the frames of docs/symbols.md.

    build/venv/bin/python -m equipoise_robot.models        # writes models/*.xml and *.urdf from config/*.toml

The URDF's base_link has the axes of ROS (REP 103: x forward, y left, z up); its body has the robot's own.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._data import ROBOTS
from .simulation import request

G = 9.8  # [T] Tables 3.2, 5.2
HOLDS, HOLDS_RADIUS_M = 2.0, 0.1  # friction of a floor that is said never to let slip, about the vertical too
TYRE_GRIP = 0.8  # rubber on a hard floor; the tyres touch at points and do not scrub
TYRE_M = 0.016  # width, to look at
MM = "0.001 0.001 0.001"  # mesh files are in millimetres
LIGHT_KG, LIGHT_KG_M2 = 1e-6, 1e-10  # of URDF links that only carry a joint: engines refuse 0
# Body axes in those of base_link, the columns of R_FB. The eduMIP's body has x left, y back.
R_FB = {"mbbr": np.eye(3), "mip": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])}

Numbers = tuple[float, ...]


@dataclass
class Floor:
    """What the robot stands on: slope towards x, y, and sills (x, y, angle, length, width, height; SI)."""

    slope_rad: tuple[float, float] = (0.0, 0.0)
    sills: list[tuple[float, float, float, float, float, float]] = field(default_factory=list)

    def xml(self, contact: str) -> str:
        x, y = self.slope_rad
        boxes = "".join(
            f'<geom type="box" pos="{at_x:.6g} {at_y:.6g} 0" euler="0 0 {angle:.6g}" '
            f'size="{length / 2:.6g} {width / 2:.6g} {height:.6g}" {contact}/>\n      '
            for at_x, at_y, angle, length, width, height in self.sills
        )
        return (
            f'<body name="ground" zaxis="{-x:.9g} {-y:.9g} 1">\n'
            f'      <geom name="floor" type="plane" size="50 50 1" {contact}/>\n      {boxes}</body>'
        )


@dataclass(frozen=True)
class Shape:
    """To look at; cylinder: radius, length along `axis`; box: three edges; sphere: radius; mesh: a file."""

    kind: str
    size: Numbers = ()
    at: Numbers = (0.0, 0.0, 0.0)
    axis: Numbers = (0.0, 0.0, 1.0)
    rgba: str = "0.2 0.2 0.2 1"
    file: str = ""


@dataclass(frozen=True)
class Body:
    """A rigid body with the axes of B. It hangs on its parent by a joint at `at`; without one it is free."""

    name: str
    mass_kg: float
    inertia_kg_m2: Numbers  # about its centre of mass
    shape: Shape
    com: Numbers = (0.0, 0.0, 0.0)
    parent: str = ""
    at: Numbers = (0.0, 0.0, 0.0)
    joint: str = "free"  # free, ball, hinge
    axis: Numbers = (1.0, 0.0, 0.0)  # of a hinge
    armature_kg_m2: float = 0.0
    rolls_m: float = 0.0  # radius that touches the floor; 0: nothing does


def numbers(values: float | Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in np.atleast_1d(np.asarray(values, float)) + 0.0)


def rolling_radius_m(robot: str, d: dict[str, Any]) -> float:
    """Of what touches the floor."""
    return float(d["ball_radius_m" if robot == "mbbr" else "wheel_radius_m"])


def bodies(robot: str, d: dict[str, Any], mesh: str = "") -> list[Body]:
    """What MuJoCo moves, by _core.dimensions; the first is the robot's body, which looks like a mesh file."""
    tall, r = 2.0 * d["com_height_m"], rolling_radius_m(robot, d)
    low = 1.3 * r if robot == "mbbr" else 0.0
    middle = (0.0, 0.0, (low + tall) / 2)
    looks = {
        "mbbr": Shape("cylinder", (1.5 * r, tall - low), middle, rgba="0.3 0.4 0.6 0.5"),
        "mip": Shape("box", (0.05, 0.03, tall), middle, rgba="0.3 0.4 0.6 0.5"),
    }
    com = (0.0, 0.0, d["com_height_m"])
    look = Shape("mesh", rgba="0.3 0.4 0.6 1", file=mesh) if mesh else looks[robot]
    body = Body("robot", d["body_mass_kg"], tuple(d["body_inertia_kg_m2"]), look, com)
    if robot == "mbbr":  # the wheels' inertia is the joint's armature
        moments = (d["ball_inertia_kg_m2"],) * 3
        armature = d["wheel_inertia_about_ball_kg_m2"]
        shape = Shape("sphere", (r,))
        ball = Body("ball", d["ball_mass_kg"], moments, shape, parent="robot", joint="ball", rolls_m=r)
        return [body, Body(**vars(ball) | {"armature_kg_m2": armature})]
    # The first wheel, of u_x + u_z, is the right one.
    return [
        body,
        *(
            Body(
                name,
                d["wheel_mass_kg"],
                tuple(d["wheel_inertia_kg_m2"]),
                Shape("cylinder", (r, TYRE_M), axis=(1.0, 0.0, 0.0)),
                parent="robot",
                at=(x, 0.0, 0.0),
                joint="hinge",
                armature_kg_m2=d["rotor_inertia_kg_m2"],
                rolls_m=r,
            )
            for name, x in (("right", -d["track_m"] / 2), ("left", d["track_m"] / 2))
        ),
    ]


def omniwheels(d: dict[str, Any]) -> list[Body]:
    """The MBBR's, for a URDF to show: mass and inertia are counted in the body's."""
    r, r_w = d["ball_radius_m"], d["wheel_radius_m"]
    return [
        Body(
            f"wheel_{i + 1}",
            LIGHT_KG,
            (LIGHT_KG_M2,) * 3,
            Shape("cylinder", (r_w, 0.4 * r_w), axis=tuple(axis)),
            parent="robot",
            at=tuple((r + r_w) * np.array(contact)),
            joint="hinge",
            axis=tuple(-np.array(axis)),  # it turns against the ball
        )
        for i, (axis, contact) in enumerate(zip(d["wheel_axes"], d["wheel_contacts"], strict=True))
    ]


def robot_bodies(robot: str, d: dict[str, Any], mesh: str = "") -> list[Body]:
    return bodies(robot, d, mesh) + (omniwheels(d) if robot == "mbbr" else [])


def possible(moments: Numbers) -> Numbers:
    """The nearest that compilers take: no moment exceeds the sum of the others, as `numbers` rounds them.

    [T] Table 3.2's wheel does, as it carries its motor's rotor; `exact` has the numbers of the equations.
    """
    total = sum(moments)
    return tuple(min(moment, (total - moment) * (1 - 1e-7)) for moment in moments)


# --- MJCF ---


def mjcf_shape(shape: Shape) -> str:
    sizes = {"cylinder": (1.0, 0.5), "box": (0.5, 0.5, 0.5), "sphere": (1.0,), "mesh": ()}[shape.kind]
    size = f'mesh="{shape.file}"' if shape.file else f'size="{numbers(np.multiply(shape.size, sizes))}"'
    turned = f' zaxis="{numbers(shape.axis)}"' if shape.axis != (0.0, 0.0, 1.0) else ""
    return (
        f'<geom type="{shape.kind}" pos="{numbers(shape.at)}" {size}{turned}\n'
        f'              contype="0" conaffinity="0" rgba="{shape.rgba}"/>'
    )


def mjcf_body(body: Body, inside: str, contact: str) -> str:
    joint = {
        "free": '<freejoint name="base"/>',
        "ball": f'<joint name="{body.name}" type="ball" armature="{body.armature_kg_m2:.9g}"/>',
        "hinge": f'<joint name="{body.name}" type="hinge" axis="{numbers(body.axis)}" '
        f'armature="{body.armature_kg_m2:.9g}"/>',
    }[body.joint]
    # Tyres touch at a point, and each other never.
    rolls = (
        f'\n        <geom type="sphere" size="{body.rolls_m:.9g}" {contact}\n'
        '              conaffinity="0" rgba="0 0 0 0"/>'
    )
    return f"""<body name="{body.name}" pos="{numbers(body.at)}">
        {joint}
        <inertial pos="{numbers(body.com)}" mass="{body.mass_kg:.9g}"
                  diaginertia="{numbers(possible(body.inertia_kg_m2))}"/>
        {mjcf_shape(body.shape)}{rolls if body.rolls_m else ""}{inside}
      </body>"""


def mjcf(robot: str, d: dict[str, Any], floor: Floor | None = None, mesh: str = "") -> str:
    """`inertia_NAME`: exact moments, which mujoco_engine gives to the compiled model.

    Without its noslip iterations MuJoCo's contacts creep under load: a ball that should stick spins.
    """
    grip, radius = d.get("floor_grip", TYRE_GRIP), d.get("floor_torsion_radius_m", 0.0)
    if not grip:
        grip, radius = HOLDS, HOLDS_RADIUS_M
    friction = numbers([grip, grip * radius, 0.0])
    contact = f'friction="{friction}" condim="4" solref="0.002 1"'
    body, *others = bodies(robot, d, mesh)
    inside = f'\n        <site name="imu" pos="{numbers(d["imu_position_m"])}"/>'
    inside += "".join("\n      " + mjcf_body(other, "", contact) for other in others)
    standing = Body(**vars(body) | {"at": (0.0, 0.0, others[0].rolls_m)})
    exact = "".join(
        f'<numeric name="inertia_{b.name}" data="{numbers(b.inertia_kg_m2)}"/>'
        for b in (body, *others)
        if robot == "mip"
    )
    asset = f'<asset><mesh name="{mesh}" file="{mesh}" scale="{MM}"/></asset>' if mesh else ""
    return f"""<mujoco model="{Path(ROBOTS[robot]).stem}">
  {f"<custom>{exact}</custom>" if exact else ""}{asset}
  <compiler angle="radian"/>
  <option timestep="{d["step_s"]:.9g}" gravity="0 0 -{G}" integrator="implicitfast" cone="elliptic"
          impratio="20" noslip_iterations="3"/>
  <worldbody>
    <light pos="0 0 3"/>
    {(floor or Floor(tuple(d["floor_slope_rad"]))).xml(contact)}
    {mjcf_body(standing, inside, contact)}
  </worldbody>
  <sensor>
    <gyro name="gyro" site="imu"/>
    <accelerometer name="accel" site="imu"/>
  </sensor>
</mujoco>
"""


# --- URDF ---


def origin(at: Iterable[float], rpy: Iterable[float] = (0.0, 0.0, 0.0)) -> str:
    turned = " ".join(f"{angle:.16g}" for angle in rpy)  # a quarter turn is none to nine digits
    return f'<origin xyz="{numbers(at)}" rpy="{turned}"/>'


def urdf_link(body: Body) -> str:
    shape = body.shape
    names = {"cylinder": ("radius", "length"), "box": ("size",), "sphere": ("radius",), "mesh": ()}[
        shape.kind
    ]
    sizes: tuple[Any, ...] = (shape.size,) if shape.kind == "box" else shape.size
    geometry = " ".join(f'{name}="{numbers(size)}"' for name, size in zip(names, sizes, strict=True))
    if shape.file:
        geometry = f'filename="{shape.file}" scale="{MM}"'
    x, y, z = shape.axis
    turned = (0.0, math.acos(max(-1.0, min(1.0, z))), math.atan2(y, x))
    looks = f"""{origin(shape.at, turned)}
      <geometry><{shape.kind} {geometry}/></geometry>"""
    # Of what rolls, the shape touches the floor too.
    touches = f"\n    <collision>{looks}</collision>" if body.rolls_m else ""
    return f"""  <link name="{body.name}">
    {urdf_inertia(body.mass_kg, possible(body.inertia_kg_m2), body.com)}
    <visual>{looks}
      <material name="{body.name}"><color rgba="{shape.rgba}"/></material></visual>{touches}
  </link>
"""


def urdf_inertia(mass_kg: float, moments: Numbers, com: Numbers = (0.0, 0.0, 0.0)) -> str:
    xx, yy, zz = (f"{moment:.9g}" for moment in moments)
    return (
        f'<inertial>{origin(com)}<mass value="{mass_kg:.9g}"/>\n'
        f'      <inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'
    )


def urdf_joint(name: str, parent: str, child: str, at: Iterable[float], turns: str = "", **rpy: Any) -> str:
    """`turns`: the axis; without, the joint is fixed."""
    kind, axis = ("continuous", f'<axis xyz="{turns}"/>') if turns else ("fixed", "")
    return (
        f'  <joint name="{name}" type="{kind}">{origin(at, **rpy)}\n'
        f'    <parent link="{parent}"/><child link="{child}"/>{axis}</joint>\n'
    )


def fixed_frames(robot: str, d: dict[str, Any]) -> dict[str, tuple[NDArray[np.float64], float]]:
    """Frames on base_link: position, and yaw of their axes."""
    forward = R_FB[robot]
    return {
        "robot": (np.zeros(3), math.atan2(forward[1, 0], forward[0, 0])),
        "imu_link": (forward @ np.array(d["imu_position_m"]), 0.0),
    }


def urdf(robot: str, d: dict[str, Any], mesh: str = "") -> str:
    """The ball's joint is three hinges, for URDF knows no other: near them it turns as it should.

    For simulation there is the MJCF: a URDF cannot say that omniwheels turn the ball.
    """
    text = '  <link name="base_link"/>\n  <link name="imu_link"/>\n'
    for name, (at, yaw) in fixed_frames(robot, d).items():
        text += urdf_joint(f"{name}_fixed", "base_link", name, at, rpy=(0.0, 0.0, yaw))
    for body in robot_bodies(robot, d, mesh):
        text += urdf_link(body)
        if body.joint == "hinge":
            text += urdf_joint(body.name, body.parent, body.name, body.at, numbers(body.axis))
        elif body.joint == "ball":
            carriers = [f"{body.name}_{axis}" for axis in "xy"]
            light = urdf_inertia(LIGHT_KG, (LIGHT_KG_M2,) * 3)
            text += "".join(f'  <link name="{carrier}">{light}</link>\n' for carrier in carriers)
            chain = [body.parent, *carriers, body.name]
            for i, axis in enumerate("xyz"):
                turns = numbers(np.eye(3)[i])
                text += urdf_joint(f"{body.name}_about_{axis}", chain[i], chain[i + 1], body.at, turns)
    return f'<?xml version="1.0"?>\n<robot name="{Path(ROBOTS[robot]).stem}">\n{text}</robot>\n'


def dimensions(config: str | Path) -> tuple[str, dict[str, Any]]:
    """The robot's name, and the numbers of the robot as configured."""
    asked = request(config)
    return _core.robot_type(asked.config), json.loads(_core.dimensions(asked))


FORMATS: dict[str, Callable[..., str]] = {"xml": mjcf, "urdf": urdf}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_robot.models", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=Path("models"), help="folder (default: models)")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    try:
        from . import body
    except ModuleNotFoundError as error:
        meshes = False
        print(f"note: bodies without meshes: {error}")
    else:
        meshes = True
    for name, config in ROBOTS.items():
        robot, d = dimensions(name)
        stl = ""
        if meshes:
            stl = f"{Path(config).stem}.stl"
            body.mesh(body.looks(body.assemble(name))).export(out / stl)
            print(out / stl)
        for suffix, write in FORMATS.items():
            path = (out / config).with_suffix(f".{suffix}")
            path.write_text(write(robot, d, mesh=stl))
            print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
