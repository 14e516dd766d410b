"""Solids of a body around a robot's wheels, by its configuration: what is printed, envelopes of the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._data import need
from .models import TYRE_M

m3 = need("manifold3d", "mesh")
Solid = Any  # manifold3d.Manifold

WALL, GAP, FIT, PLATE, POST = 3e-3, 1.5e-3, 2e-4, 3e-3, 3.5e-3  # ours: what common printers make well
SUPPORT_BALL = 2e-3  # radius; ours. [T] 2.3.4: six, below the ball's equator
CLAMP = 12e-3  # of a motor, along it
OMNIWHEEL_M = 10e-3  # width: two rows of six rollers, [T] 2.3.1
ROLLER_RAD = np.radians(18.0)  # half of what a roller spans; two rows of six need 15, 3 overlap: ours
PIN_M, SHAFT_M = 1e-3, 4e-3  # diameters; the motor's shaft below
SEGMENTS, COARSE = 32, 6  # of a circle: what is printed; what models show
m3.set_circular_segments(SEGMENTS)
ROUND = 2e-5  # edges below it are merged
MEASURE = "unknown: an allowance, measure yours"


@dataclass(frozen=True)
class Bought:
    """Its envelope: a box, or diameter and length of a cylinder."""

    size_m: tuple[float, ...]
    source: str
    mass_kg: float | None = None  # of one


BOARD = "outline 86.4 x 53.3 mm: BeagleBone; height of the stack an allowance, mass unknown: measure yours"
BOUGHT: dict[str, dict[str, Bought]] = {
    "mbbr": {
        "motor": Bought((0.025, 0.063), "Pololu 25Dx63L, its name; mass unknown: measure yours"),
        "omniwheel": Bought(
            (0.0, OMNIWHEEL_M), "robot.wheel_radius_m, width ours; mass unknown: measure yours"
        ),
        "drivers": Bought((0.075, 0.035, 0.009), MEASURE),
        "board": Bought((0.0533, 0.020, 0.0864), BOARD),
        "battery": Bought((0.070, 0.035, 0.018), MEASURE),
    },
    "mip": {
        "motor": Bought((0.016, 0.023), MEASURE),
        "board": Bought((0.0533, 0.016, 0.0864), BOARD),
        "battery": Bought((0.035, 0.018, 0.070), MEASURE),
    },
}


@dataclass(frozen=True)
class Part:
    name: str
    solid: Solid  # where it is in the body's axes, metres
    printed: bool = False


# --- Solids ---


def frame_of(axis: Any) -> NDArray[np.float64]:
    """A rotation whose third column is the axis."""
    z = np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def rod(diameter: float, start: Any, end: Any) -> Solid:
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(end - start))
    made = m3.Manifold.cylinder(length, diameter / 2)
    return made.transform(np.column_stack([frame_of(end - start), start]))


def box(size: Any, at: Any) -> Solid:
    return m3.Manifold.cube(list(size), True).translate(list(at))


def sphere(radius: float, at: Any = (0.0, 0.0, 0.0)) -> Solid:
    return m3.Manifold.sphere(radius).translate(list(at))


def together(solids: list[Solid]) -> Solid:
    return m3.Manifold.batch_boolean(solids, m3.OpType.Add)


def whole(solid: Solid) -> Solid:
    """Without the slivers that cuts leave: what a printer would make of one piece."""
    return max(solid.simplify(ROUND).decompose(), key=lambda piece: piece.volume())


# --- The MBBR ---


def supports(d: dict[str, Any]) -> list[NDArray[np.float64]]:
    """Directions from the ball's centre to the six support balls, 20 degrees below its equator."""
    down, (x, y, _) = np.radians(20.0), d["wheel_contacts"][0]
    around = np.arctan2(y, x) + np.arange(6) * np.pi / 3
    return [np.array([np.cos(a) * np.cos(down), np.sin(a) * np.cos(down), -np.sin(down)]) for a in around]


def mbbr(d: dict[str, Any], sizes: dict[str, tuple[float, ...]], plain: bool) -> list[Part]:
    """A cage that holds the ball and clamps the motors, which stand along their wheels' axes; a tower.

    plain: without holes, to look at.
    """
    r, r_w = d["ball_radius_m"], d["wheel_radius_m"]
    motor_d, motor_l = sizes["motor"]
    axes = [np.array(axis) * np.sign(axis[2] or 1.0) for axis in d["wheel_axes"]]
    hubs = [(r + r_w) * np.array(contact) for contact in d["wheel_contacts"]]
    width = sizes["omniwheel"][1]
    begins = width / 2 + GAP
    axles = [
        (hub + begins * axis, hub + (begins + motor_l) * axis) for hub, axis in zip(hubs, axes, strict=True)
    ]
    motors = [rod(motor_d, *axle) for axle in axles]

    def around(axle: Any) -> Solid:
        along = (axle[1] - axle[0]) / motor_l
        return rod(motor_d + 2 * FIT, axle[0] - FIT * along, axle[1] + FIT * along)

    def clamp(axle: Any) -> Solid:
        start, end = axle
        return rod(motor_d + 2 * WALL, start, start + CLAMP * (end - start) / motor_l)

    wheels = [
        rod(2 * r_w, hub - width / 2 * axis, hub + width / 2 * axis)
        for hub, axis in zip(hubs, axes, strict=True)
    ]
    room = [sphere(r + GAP), *(around(axle) for axle in axles)] + [
        rod(2 * (r_w + GAP), hub - (width + GAP) / 2 * axis, hub + (width + GAP) / 2 * axis)
        for hub, axis in zip(hubs, axes, strict=True)
    ]

    # The cage: down to half a radius below the equator, with pockets for six support balls.
    outer, below, above = r + GAP + WALL, -r / 2, hubs[0][2]
    pockets = [sphere(SUPPORT_BALL, (r + SUPPORT_BALL) * out) for out in supports(d)]

    # The tower stands on the motors: its lowest deck clamps their upper ends.
    deck = max(motor.bounding_box()[5] for motor in motors) - 2 * PLATE
    cage = together([rod(2 * outer, (0, 0, below), (0, 0, above)), *(clamp(motor) for motor in axles)])
    x, y, z = d["imu_position_m"]
    wide, thick, tall = sizes["board"]
    board = box(sizes["board"], (x, y, z))
    drivers = box(sizes["drivers"], (0, 0, deck + PLATE + sizes["drivers"][2] / 2))
    upper = z + tall / 2 + GAP
    battery = box(sizes["battery"], (0, 0, upper + PLATE + sizes["battery"][2] / 2))
    lid = upper + PLATE + sizes["battery"][2] + GAP
    flat = np.hypot(abs(x) + wide / 2, abs(y) + thick / 2)
    columns = max(flat, np.hypot(sizes["battery"][0], sizes["battery"][1]) / 2) + POST + GAP
    reach = columns + POST + WALL
    plates = [rod(2 * reach, (0, 0, at), (0, 0, at + PLATE)) for at in (deck, upper, lid)]
    posts = []
    for i in range(3):
        azimuth = np.pi / 2 + i * 2 * np.pi / 3
        at = columns * np.array([np.cos(azimuth), np.sin(azimuth)])
        posts.append(rod(2 * POST, (*at, deck), (*at, lid + PLATE)))
    cut = m3.Manifold() if plain else together([*room, *pockets, drivers, board, battery])
    return [
        Part("cage", whole(cage - cut), printed=True),
        Part(
            "tower",
            whole(together([*plates, *posts, *(clamp(motor[::-1]) for motor in axles)]) - cut),
            printed=True,
        ),
        *(Part("motor", motor) for motor in motors),
        *(Part("omniwheel", wheel) for wheel in wheels),
        Part("drivers", drivers),
        Part("board", board),
        Part("battery", battery),
    ]


# --- The eduMIP ---


def mip(d: dict[str, Any], sizes: dict[str, tuple[float, ...]], plain: bool) -> list[Part]:
    """A bracket around the motors, a plate with the board behind it; a tray whose battery weighs it up."""
    motor_d, motor_l = sizes["motor"]
    board, battery = np.array(sizes["board"]), np.array(sizes["battery"])
    inner = d["track_m"] / 2 - TYRE_M / 2 - GAP
    motors = [rod(motor_d, (side * (inner - motor_l), 0, 0), (side * inner, 0, 0)) for side in (-1, 1)]
    at = np.array(d["imu_position_m"])
    face = at[1] - board[1] / 2  # of the plate, towards the board
    top, bottom = at[2] + board[2] / 2, -motor_d / 2 - WALL
    plate = box((board[0], PLATE, top - bottom), (0, face - PLATE / 2, (top + bottom) / 2))
    bracket = box((2 * inner, motor_d + 2 * WALL, motor_d + 2 * WALL), (0, 0, 0))
    low = motor_d / 2 + WALL
    before = min(-at[1] * np.prod(board) / np.prod(battery), face - PLATE - battery[1] / 2)
    shelf = (0, before, low + battery[2] / 2)
    front = before - battery[1] / 2 - WALL
    tray = box((battery[0], face - front, PLATE), (0, (face + front) / 2, low - PLATE / 2))
    lip = box((battery[0], WALL, 2 * low), (0, front + WALL / 2, low))
    room = m3.Manifold() if plain else together([*motors, box(board, at), box(battery, shelf)])
    return [
        Part("chassis", whole(together([plate, bracket, tray, lip]) - room), printed=True),
        *(Part("motor", motor) for motor in motors),
        Part("board", box(board, at)),
        Part("battery", box(battery, shelf)),
    ]


def omniwheel(d: dict[str, Any]) -> dict[str, Solid]:
    """To print: one hub and twelve rollers that make it a circle from the side; axis z, pins of wire."""
    r_w = d["wheel_radius_m"]
    half = r_w * np.sin(ROLLER_RAD)
    pitch = r_w * (np.cos(ROLLER_RAD) - 0.105)  # radius of the pins' circle; leaves the rollers' ends a wall
    along = np.linspace(-half, half, 17)

    def barrel(more: float) -> Solid:
        profile = [(np.sqrt(r_w**2 - s**2) - pitch + more, s) for s in along]
        profile = [(0.0, -half - more), (profile[0][0], -half - more), *profile]
        profile += [(profile[-1][0], half + more), (0.0, half + more)]
        made = m3.CrossSection([profile]).revolve()  # about z
        return made.rotate([90.0, 0.0, 0.0])

    def around(solid: Solid) -> list[Solid]:
        rows = [(OMNIWHEEL_M / 4, 0.0), (-OMNIWHEEL_M / 4, 30.0)]
        return [
            solid.translate([pitch, 0.0, z]).rotate([0.0, 0.0, turned + 60.0 * i])
            for z, turned in rows
            for i in range(6)
        ]

    pin = rod(PIN_M + FIT, (0, -2 * half, 0), (0, 2 * half, 0))
    hub = rod(2 * pitch + PIN_M + 2 * FIT + GAP, (0, 0, -OMNIWHEEL_M / 2), (0, 0, OMNIWHEEL_M / 2))
    bore = rod(SHAFT_M + FIT, (0, 0, -OMNIWHEEL_M), (0, 0, OMNIWHEEL_M))
    roller = whole(barrel(0.0) - pin)
    cut = together([bore, *around(barrel(2 * FIT)), *around(pin)])
    return {
        "omniwheel_hub": whole(hub - cut),
        "omniwheel_roller": roller,
        "omniwheel": together([hub - cut, *around(roller)]),
    }
