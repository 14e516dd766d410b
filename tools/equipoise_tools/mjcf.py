"""MJCF of a robot from its dimensions: the bodies that MuJoCo moves, in the frames of docs/symbols.md.

build/venv/bin/python -m equipoise_tools.mjcf        # writes models/*.xml from config/*.toml
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .paths import repository_root

G = 9.8  # [T] Tables 3.2, 5.2
HOLDS = 2.0  # friction coefficient of a floor that is said never to let slip
TYRE_GRIP = 0.8  # rubber on a hard floor; the tyres touch at points and do not scrub


@dataclass
class Floor:
    """What the robot stands on: slope towards x, y, and sills (x, y, angle, length, width, height; SI)."""

    slope_rad: tuple[float, float] = (0.0, 0.0)
    sills: list[tuple[float, float, float, float, float, float]] = field(default_factory=list)

    def xml(self, friction: str) -> str:
        contact = f'friction="{friction}" condim="4" solref="0.002 1"'
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


def numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in np.atleast_1d(values))


def inertia(moments: list[float]) -> str:
    """The nearest that MuJoCo's compiler takes: no moment exceeds the sum of the others.

    [T] Table 3.2's wheel does, as it carries its motor's rotor; `exact` has the numbers of the equations.
    """
    total = sum(moments)
    return numbers([min(moment, (total - moment) * (1 - 1e-9)) for moment in moments])


def document(name: str, step_s: float, world: str, exact: dict[str, list[float]]) -> str:
    """`exact`: moments of bodies by name, which mujoco_engine gives to the compiled model.

    Without its noslip iterations MuJoCo's contacts creep under load: a ball that should stick spins.
    """
    moments = "".join(
        f'<numeric name="inertia_{body}" data="{numbers(values)}"/>' for body, values in exact.items()
    )
    return f"""<mujoco model="{name}">
  {f"<custom>{moments}</custom>" if exact else ""}
  <compiler angle="radian"/>
  <option timestep="{step_s:.9g}" gravity="0 0 -{G}" integrator="implicitfast" cone="elliptic"
          impratio="20" noslip_iterations="3"/>
  <worldbody>
    <light pos="0 0 3"/>
    {world}
  </worldbody>
  <sensor>
    <gyro name="gyro" site="imu"/>
    <accelerometer name="accel" site="imu"/>
  </sensor>
</mujoco>
"""


def mbbr(d: dict, floor: Floor) -> str:
    """A free body on a ball that it turns by a ball joint; the wheels' inertia is the joint's armature."""
    grip = d["floor_grip"] or HOLDS
    friction = numbers([grip, grip * d["floor_torsion_radius_m"], 0.0])
    r, height = d["ball_radius_m"], 2.0 * d["com_height_m"]
    body = f"""<body name="robot" pos="0 0 {r:.9g}">
      <freejoint name="base"/>
      <inertial pos="0 0 {d["com_height_m"]:.9g}" mass="{d["body_mass_kg"]:.9g}"
                diaginertia="{inertia(d["body_inertia_kg_m2"])}"/>
      <site name="imu" pos="{numbers(d["imu_position_m"])}"/>
      <geom type="cylinder" fromto="0 0 {1.3 * r:.6g} 0 0 {height:.6g}" size="{1.5 * r:.6g}" contype="0"
            conaffinity="0" rgba="0.3 0.4 0.6 0.5"/>
      <body name="ball">
        <joint name="wheels" type="ball" armature="{d["wheel_inertia_about_ball_kg_m2"]:.9g}"/>
        <inertial pos="0 0 0" mass="{d["ball_mass_kg"]:.9g}"
                  diaginertia="{numbers([d["ball_inertia_kg_m2"]] * 3)}"/>
        <geom type="sphere" size="{r:.9g}" friction="{friction}" condim="4" solref="0.002 1"/>
      </body>
    </body>"""
    return document("mbbr", d["step_s"], floor.xml(friction) + "\n    " + body, {})


def edumip(d: dict, floor: Floor) -> str:
    """Body x left, y back, z up; the first wheel, of u_x + u_z, is the right one. Tyres touch at a point."""
    friction = numbers([TYRE_GRIP, 0.0, 0.0])
    r = d["wheel_radius_m"]
    wheels = "".join(f"""
      <body name="{name}" pos="{x:.9g} 0 0">
        <joint name="{name}" type="hinge" axis="1 0 0" armature="{d["rotor_inertia_kg_m2"]:.9g}"/>
        <inertial pos="0 0 0" mass="{d["wheel_mass_kg"]:.9g}"
                  diaginertia="{inertia(d["wheel_inertia_kg_m2"])}"/>
        <geom type="sphere" size="{r:.9g}" friction="{friction}" condim="4" solref="0.002 1" conaffinity="0"
              rgba="0 0 0 0"/>
        <geom type="cylinder" fromto="-0.008 0 0 0.008 0 0" size="{r:.9g}" contype="0" conaffinity="0"
              rgba="0.2 0.2 0.2 1"/>
      </body>""" for name, x in (("right", -d["track_m"] / 2), ("left", d["track_m"] / 2)))
    body = f"""<body name="robot" pos="0 0 {r:.9g}">
      <freejoint name="base"/>
      <inertial pos="0 0 {d["com_height_m"]:.9g}" mass="{d["body_mass_kg"]:.9g}"
                diaginertia="{inertia(d["body_inertia_kg_m2"])}"/>
      <site name="imu" pos="{numbers(d["imu_position_m"])}"/>
      <geom type="box" pos="0 0 {d["com_height_m"]:.6g}" size="0.025 0.015 {d["com_height_m"]:.6g}"
            contype="0" conaffinity="0" rgba="0.3 0.4 0.6 0.5"/>{wheels}
    </body>"""
    wheel = d["wheel_inertia_kg_m2"]
    exact = {"robot": d["body_inertia_kg_m2"], "right": wheel, "left": wheel}
    return document("edumip", d["step_s"], floor.xml(friction) + "\n    " + body, exact)


BY_TYPE = {"mbbr": mbbr, "mip": edumip}
FILES = {"mbbr": ("config/mbbr.toml", "models/mbbr.xml"), "mip": ("config/edumip.toml", "models/edumip.xml")}


def typical(robot: str) -> str:
    """Of the robot as configured, on a level floor."""
    from equipoise_robot import _core

    request = _core.Request()
    request.config = str(repository_root() / FILES[robot][0])
    return BY_TYPE[robot](json.loads(_core.dimensions(request)), Floor())


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m equipoise_tools.mjcf", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=repository_root(), help="folder that holds models/")
    out = parser.parse_args().out
    (out / "models").mkdir(parents=True, exist_ok=True)
    for robot, (_, name) in FILES.items():
        (out / name).write_text(typical(robot))
        print(out / name)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
