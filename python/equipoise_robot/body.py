"""A printable body around a robot's wheels, by its configuration: STL files, and its [robot] keys.

    python -m equipoise_robot.body mbbr --out build/body --mass motor=0.09 > mine.toml

Parts that nobody has weighed share by volume what the configured mass leaves.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._data import configuration, need
from .errors import UserError
from .models import dimensions
from .shapes import BOUGHT, COARSE, SEGMENTS, Bought, Part, Solid, m3, mbbr, mip, omniwheel, sphere, together

PLA_KG_M3 = 1240.0  # specific gravity 1.24, data sheet of Ingeo 4043D
SLIVER_M3 = 1e-10  # of an overlap that is rounding


@dataclass(frozen=True)
class Properties:
    mass_kg: float
    com_m: NDArray[np.float64]
    inertia_kg_m2: NDArray[np.float64]  # about the centre of mass


def mesh(solid: Solid) -> Any:
    """As trimesh has it, in millimetres as slicers take them."""
    made = solid.to_mesh64()
    scaled = 1000.0 * np.asarray(made.vert_properties)[:, :3]
    return need("trimesh", "mesh").Trimesh(scaled, np.asarray(made.tri_verts), process=True)


def properties(solid: Solid, density_kg_m3: float) -> Properties:
    made = mesh(solid)
    made.density = density_kg_m3 * 1e-9
    return Properties(made.mass, made.center_mass * 1e-3, made.moment_inertia * 1e-6)


def sum_of(parts: list[Properties]) -> Properties:
    mass = sum(part.mass_kg for part in parts)
    com = np.sum([part.mass_kg * part.com_m for part in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        away = part.com_m - com
        inertia += part.inertia_kg_m2 + part.mass_kg * (away @ away * np.eye(3) - np.outer(away, away))
    return Properties(mass, com, inertia)


# --- What it weighs ---


@dataclass(frozen=True)
class Body:
    robot: str | Path  # as assemble was asked
    dimensions: dict[str, Any]
    parts: list[Part]
    bought: dict[str, Bought]
    printed_kg: float
    shared_kg_m3: float  # density of what nobody has weighed; 0: all is weighed
    total: Properties


def solids(robot: str, d: dict[str, Any], bought: dict[str, Bought], plain: bool = False) -> list[Part]:
    return {"mbbr": mbbr, "mip": mip}[robot](d, {name: part.size_m for name, part in bought.items()}, plain)


def assemble(
    robot: str | Path,
    sizes: dict[str, tuple[float, ...]] | None = None,
    masses: dict[str, float] | None = None,
    density_kg_m3: float = PLA_KG_M3,
) -> Body:
    """The body of the configured robot; sizes and masses of bought parts in place of ours."""
    kind, d = dimensions(robot)
    bought = dict(BOUGHT[kind])
    for name in [*(sizes or {}), *(masses or {})]:
        if name not in bought:
            raise UserError(f"{name}: no part of this robot; they are {', '.join(bought)}")
    for name, size in (sizes or {}).items():
        if len(size) != len(bought[name].size_m) or not all(0.0 < edge < 1.0 for edge in size):
            raise UserError(f"size of {name}: {len(bought[name].size_m)} lengths in metres, above 0, below 1")
        bought[name] = replace(bought[name], size_m=size)
    for name, mass_kg in (masses or {}).items():
        if not 0.0 < mass_kg < 100.0:
            raise UserError(f"mass of {name}: {mass_kg:g} kg is out of range, 0 to 100")
        bought[name] = replace(bought[name], mass_kg=mass_kg)
    if not 0.0 < density_kg_m3 < 25e3:
        raise UserError(f"density: {density_kg_m3:g} kg/m3 is out of range, 0 to 25000")
    parts = solids(kind, d, bought)
    ball = [Part("ball", sphere(d["ball_radius_m"]))] if kind == "mbbr" else []
    for a, b in itertools.combinations(parts + ball, 2):
        if (shared := (a.solid ^ b.solid).volume()) > SLIVER_M3:
            raise UserError(
                f"{a.name} and {b.name} overlap by {shared * 1e6:.2f} cm3: other --size, or place"
            )
    printed = [properties(part.solid, density_kg_m3) for part in parts if part.printed]
    weighed, unweighed = list(printed), []
    for part in parts:
        if part.printed:
            continue
        mass = bought[part.name].mass_kg
        if mass is None:
            unweighed.append(part.solid)
        else:
            weighed.append(properties(part.solid, mass / part.solid.volume()))
    shared_kg_m3 = 0.0
    if unweighed:
        left = d["body_mass_kg"] - sum(part.mass_kg for part in weighed)
        if left <= 0:
            raise UserError(
                f"robot.body_mass_kg = {d['body_mass_kg']} leaves nothing for what is not weighed: "
                "weigh every part (--mass)"
            )
        shared_kg_m3 = left / sum(solid.volume() for solid in unweighed)
        weighed += [properties(solid, shared_kg_m3) for solid in unweighed]
    printed_kg = sum(part.mass_kg for part in printed)
    return Body(robot, d, parts, bought, printed_kg, shared_kg_m3, sum_of(weighed))


def fragment(body: Body) -> str:
    """A configuration with the robot's as its base; comments: the base's values, and how far ours are off."""
    d = body.dimensions
    moments = np.diag(body.total.inertia_kg_m2)
    values: dict[str, Any] = {
        "body_mass_kg": body.total.mass_kg,
        "com_height_m": body.total.com_m[2],
        "body_inertia_kg_m2": list(moments),
    }
    lines = [
        f'base = "{Path(configuration(body.robot)).resolve()}"',
        f"# Printed: {1e3 * body.printed_kg:.0f} g.",
    ]
    if body.shared_kg_m3:
        names = [name for name, part in body.bought.items() if part.mass_kg is None]
        lines.append(
            f"# Not weighed: {', '.join(names)}; they share the rest of the configured mass at "
            f"{body.shared_kg_m3:.0f} kg/m3."
        )
    aside = 1e3 * float(np.hypot(*body.total.com_m[:2]))
    lines += [f"# The centre of mass is {aside:.1f} mm beside the axis.", "[robot]"]
    for key, value in values.items():
        was = np.atleast_1d(d[key])
        off = ", ".join(
            f"{round(100 * (new / old - 1), 1) + 0.0:+} %"
            for new, old in zip(np.atleast_1d(value), was, strict=True)
        )
        shown = [float(f"{number:.4g}") for number in np.atleast_1d(value)]
        lines.append(f"{key} = {shown if isinstance(value, list) else shown[0]}  # {d[key]}: {off}")
    return "\n".join(lines) + "\n"


def looks(body: Body) -> Solid:
    """One coarse solid for models to show; the omniwheels turn by themselves."""
    m3.set_circular_segments(COARSE)
    try:
        parts = solids("mbbr" if is_mbbr(body) else "mip", body.dimensions, body.bought, plain=True)
    finally:
        m3.set_circular_segments(SEGMENTS)
    return together([part.solid for part in parts if part.name != "omniwheel"])


def is_mbbr(body: Body) -> bool:
    return "omniwheel" in body.bought


def export(body: Body, folder: Path) -> list[Path]:
    """What is printed, and the whole to look at; in millimetres."""
    made = {part.name: part.solid for part in body.parts if part.printed}
    if is_mbbr(body):
        made |= {name: solid for name, solid in omniwheel(body.dimensions).items() if name != "omniwheel"}
    made["body"] = looks(body)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, solid in made.items():
        paths.append(folder / f"{name}.stl")
        mesh(solid).export(paths[-1])
    return paths


def pair(text: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    if not value:
        raise argparse.ArgumentTypeError(f"{text}: expected NAME=VALUE")
    return name, value


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UserError(f"{text}: expected a number") from None


def main(arguments: list[str] | None = None) -> int:
    about = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(prog="python -m equipoise_robot.body", description=about)
    parser.add_argument("robot", help="mbbr, mip, or a configuration file")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write the STL files there, in millimetres")
    parser.add_argument("--mass", type=pair, action="append", default=[], metavar="PART=KG", help="of one")
    parser.add_argument(
        "--size",
        type=pair,
        action="append",
        default=[],
        metavar="PART=M,M[,M]",
        help="a box, or diameter and length",
    )
    parser.add_argument(
        "--density",
        type=float,
        default=PLA_KG_M3,
        metavar="KG_M3",
        help="of what is printed (default: %(default)s, solid PLA)",
    )
    options = parser.parse_args(arguments)
    try:
        sizes = {name: tuple(number(n) for n in value.split(",")) for name, value in options.size}
        masses = {name: number(value) for name, value in options.mass}
        body = assemble(options.robot, sizes, masses, options.density)
        for path in export(body, options.out) if options.out else []:
            print(path, file=sys.stderr)
    except (UserError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(fragment(body), end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
