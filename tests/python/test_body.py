"""The parametric bodies: STL files that are solids, and the [robot] keys that they come to."""

import io
import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
body = pytest.importorskip(
    "equipoise_robot.body", reason="tools/test installs tools/requirements-optional.txt"
)
import trimesh  # noqa: E402
from equipoise_robot import UserError, _core, shapes  # noqa: E402
from equipoise_robot.simulation import request  # noqa: E402

# Robots of other sizes, by what differs from the shipped one.
ROBOTS = [
    ("mbbr", {}),
    ("mbbr", {"robot.wheel_azimuth_deg": 33.3}),
    ("mbbr", {"robot.wheel_latitude_deg": 70.0}),
    ("mbbr", {"robot.wheel_radius_m": 0.0135, "robot.imu_position_m": [0.0, 0.005, 0.15]}),
    (
        "mbbr",
        {"robot.ball_radius_m": 0.06, "robot.wheel_radius_m": 0.02, "robot.imu_position_m": [0, 0, 0.2]},
    ),
    ("mip", {}),
    ("mip", {"robot.track_m": 0.08, "robot.imu_position_m": [0.0, 0.02, 0.06]}),
]


def written(root, tmp_path, robot, changes):
    lines = [f"{key.removeprefix('robot.')} = {json.dumps(value)}" for key, value in changes.items()]
    path = tmp_path / "robot.toml"
    stem = {"mbbr": "mbbr", "mip": "edumip"}[robot]
    path.write_text("\n".join([f'base = "{root}/config/{stem}.toml"', "[robot]", *lines]))
    return path


@pytest.mark.parametrize(("robot", "changes"), ROBOTS)
def test_what_is_exported_is_watertight_and_one_piece(root, tmp_path, robot, changes):
    """As a slicer reads it: triangles without a common list of corners."""
    config = written(root, tmp_path, robot, changes)
    assembled = body.assemble(config)  # refuses parts that overlap
    paths = body.export(assembled, tmp_path)
    assert {path.stem for path in paths} == (
        {"cage", "tower", "omniwheel_hub", "omniwheel_roller", "body"}
        if robot == "mbbr"
        else {"chassis", "body"}
    )
    for path in paths:
        read = trimesh.load(path)
        assert read.is_watertight and read.is_winding_consistent and read.volume > 0, path.name
        if path.stem != "body":
            assert read.body_count == 1, path.name


def test_the_ball_the_wheels_and_their_places_are_the_configurations(root, tmp_path):
    """The cage leaves the ball its room, and each wheel stands on the ball where the model has it."""
    for changes in ({}, {"robot.ball_radius_m": 0.034}):
        config = written(root, tmp_path, "mbbr", changes)
        _, d = body.dimensions(config)
        cage, *_ = parts = body.assemble(config).parts
        r, r_w = d["ball_radius_m"], d["wheel_radius_m"]
        assert (cage.solid ^ shapes.sphere(r + 0.98 * shapes.GAP)).volume() == 0
        # Six pockets for balls that touch it from below its equator, closed behind.
        balls = [
            shapes.sphere(0.9 * shapes.SUPPORT_BALL, (r + shapes.SUPPORT_BALL) * out)
            for out in shapes.supports(d)
        ]
        assert len(balls) == 6 and all((cage.solid ^ ball).volume() == 0 for ball in balls)
        behind = [
            shapes.sphere(2e-4, (r + 2 * shapes.SUPPORT_BALL + 3e-4) * out) for out in shapes.supports(d)
        ]
        assert all((cage.solid ^ grain).volume() == pytest.approx(grain.volume()) for grain in behind)
        wheels = [part for part in parts if part.name == "omniwheel"]
        for wheel, contact in zip(wheels, d["wheel_contacts"], strict=True):
            centre = body.properties(wheel.solid, 1.0).com_m
            assert centre == pytest.approx((r + r_w) * np.array(contact), abs=1e-9)


def test_twelve_rollers_make_the_omniwheel_a_circle_and_turn_in_the_hub(root):
    _, d = body.dimensions("mbbr")
    solids = body.omniwheel(d)
    assert len(solids["omniwheel"].decompose()) == 13  # nothing touches: they turn
    r_w = 1e3 * d["wheel_radius_m"]
    outline = body.mesh(solids["omniwheel"]).vertices[:, :2]
    azimuth, radius = np.arctan2(*outline.T[::-1]), np.linalg.norm(outline, axis=1)
    for start in np.radians(np.arange(-180, 180, 5)):
        inside = radius[(azimuth >= start) & (azimuth < start + np.radians(5))]
        assert inside.max() == pytest.approx(r_w, abs=0.1)


def test_mass_and_inertia_are_those_of_mujocos_mesh_compiler(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="tools/test installs tools/requirements-optional.txt")
    for part in body.assemble("mbbr").parts[:2]:
        body.mesh(part.solid).export(tmp_path / f"{part.name}.stl")
        model = mujoco.MjModel.from_xml_string(f"""<mujoco><compiler meshdir="{tmp_path}"/><asset>
            <mesh name="part" file="{part.name}.stl" scale="0.001 0.001 0.001" inertia="exact"/></asset>
            <worldbody><body><freejoint/><geom type="mesh" mesh="part" density="1240"/></body></worldbody>
            </mujoco>""")
        ours = body.properties(part.solid, 1240.0)
        assert ours.mass_kg == pytest.approx(model.body_mass[1], rel=1e-4)
        assert ours.com_m == pytest.approx(model.body_ipos[1], abs=1e-6)
        assert np.linalg.eigvalsh(ours.inertia_kg_m2) == pytest.approx(
            sorted(model.body_inertia[1]), rel=1e-4
        )


def test_parts_add_up_as_one_solid_does():
    whole = shapes.box((0.1, 0.2, 0.3), (0.01, 0.02, 0.03))
    halves = [shapes.box((0.1, 0.2, 0.15), (0.01, 0.02, 0.03 + side * 0.075)) for side in (-1, 1)]
    added, one = body.sum_of([body.properties(half, 900.0) for half in halves]), body.properties(whole, 900.0)
    assert added.mass_kg == pytest.approx(one.mass_kg) and added.mass_kg == pytest.approx(900 * 0.006)
    assert added.com_m == pytest.approx([0.01, 0.02, 0.03])
    m = one.mass_kg
    exact = m / 12 * np.diag([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2])
    assert added.inertia_kg_m2 == pytest.approx(exact, rel=1e-9, abs=1e-12)


def test_the_keys_are_a_configuration_that_stands_and_says_the_difference(root, tmp_path):
    weighed = ["--mass", "motor=0.06", "--mass", "omniwheel=0.01", "--mass", "drivers=0.01"]
    weighed += ["--mass", "board=0.06", "--mass", "battery=0.08"]
    for robot, masses in (("mbbr", []), ("mbbr", weighed), ("mip", [])):
        command = [sys.executable, "-m", "equipoise_robot.body", robot, *masses]
        said = subprocess.run(
            command, capture_output=True, text=True, check=True, env={"PYTHONPATH": ":".join(sys.path)}
        ).stdout
        (tmp_path / "mine.toml").write_text(said)
        asked = request(tmp_path / "mine.toml")
        d = json.loads(_core.dimensions(asked))
        total = body.assemble(
            robot, masses={n: float(v) for n, v in (w.split("=") for w in masses[1::2])}
        ).total
        assert d["body_mass_kg"] == pytest.approx(total.mass_kg, rel=1e-3)
        assert d["com_height_m"] == pytest.approx(total.com_m[2], rel=1e-3)
        assert d["body_inertia_kg_m2"] == pytest.approx(np.diag(total.inertia_kg_m2), rel=1e-3)
        _, shipped = body.dimensions(robot)
        off = 100 * (total.com_m[2] / shipped["com_height_m"] - 1)
        assert f"# {shipped['com_height_m']}: {off:+.1f} %" in said
        assert ("Not weighed" in said) == (not masses)
        if masses:
            parts = 3 * 0.06 + 3 * 0.01 + 0.01 + 0.06 + 0.08
            printed = body.assemble(robot).printed_kg
            assert total.mass_kg == pytest.approx(parts + printed)
        else:
            assert total.mass_kg == pytest.approx(shipped["body_mass_kg"])
    design = [root / "build/host/equipoise", "design", "--config", tmp_path / "mine.toml"]
    assert subprocess.run(list(map(str, design)), capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"masses": {"moter": 0.1}}, "moter: no part of this robot; they are motor"),
        ({"masses": {"motor": -1.0}}, "mass of motor: -1 kg is out of range"),
        ({"masses": {"motor": float("nan")}}, "mass of motor: nan kg is out of range"),
        ({"density_kg_m3": 0.0}, "density: 0 kg/m3 is out of range"),
        ({"sizes": {"motor": (0.025,)}}, "size of motor: 2 lengths in metres"),
        ({"sizes": {"board": (0.05, 0.02, 0.0)}}, "size of board: 3 lengths in metres, above 0"),
        ({"masses": {"battery": 0.6}}, "leaves nothing for what is not weighed"),
        (
            {"sizes": {"drivers": (0.075, 0.035, 0.03)}},
            "drivers and board overlap",
        ),
        ({"sizes": {"motor": (0.03, 0.063)}}, "ball overlap"),
    ],
)
def test_what_cannot_be_built_is_refused(asked, said):
    with pytest.raises(UserError, match=said):
        body.assemble("mbbr", **asked)


@pytest.mark.parametrize("asked", ["--mass=motor=abc", "--out=/proc/none", "--size=motor=1;2"])
def test_what_is_mistyped_is_named_in_a_line(asked, capsys):
    assert body.main(["mip", asked]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1


def test_every_part_that_is_bought_says_where_its_numbers_are_from():
    for parts in shapes.BOUGHT.values():
        for part in parts.values():
            assert part.source and (part.mass_kg is not None or "measure yours" in part.source)
    for a, b in itertools.combinations(body.assemble("mip").parts, 2):
        assert (a.solid ^ b.solid).volume() < body.SLIVER_M3


def test_a_hole_in_a_mesh_is_seen():
    """The judge: a triangle less, and the mesh is no solid any more."""
    mesh = body.mesh(body.assemble("mip").parts[0].solid)
    mesh.update_faces(np.arange(len(mesh.faces)) != 7)
    assert not trimesh.load(io.BytesIO(mesh.export(file_type="stl")), file_type="stl").is_watertight
