"""models/*.xml and *.urdf: read by libraries that are not ours, against the configuration."""

import shutil
import subprocess
import tomllib

import numpy as np
import pytest

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
from equipoise_robot import models

OPTIONAL = "tools/test installs tools/requirements-optional.txt"
STEMS = {"mbbr": "mbbr", "mip": "edumip"}


@pytest.fixture(params=STEMS)
def robot(request):
    return request.param


@pytest.fixture
def configured(root, robot):
    return tomllib.loads((root / f"config/{STEMS[robot]}.toml").read_text())["robot"]


@pytest.mark.parametrize("suffix", models.FORMATS)
def test_the_committed_model_is_the_configured_robot(root, robot, suffix):
    assert (root / f"models/{STEMS[robot]}.{suffix}").read_text() == models.FORMATS[suffix](
        *models.dimensions(robot), mesh=f"{STEMS[robot]}.stl"
    ), "run build/venv/bin/python -m equipoise_robot.models"


def test_kugles_wheels_touch_the_ball_where_they_do_on_kugle(root):
    """[K]: 45 degrees from the top, the first 45 degrees from x towards y, the others 120 and 240 beyond."""
    _, kugle = models.dimensions(root / "config/kugle.toml")
    for contact, azimuth in zip(kugle["wheel_contacts"], np.radians([45.0, 165.0, 285.0]), strict=True):
        place = np.array([np.cos(azimuth), np.sin(azimuth), 1.0]) / np.sqrt(2.0)
        assert np.array(contact) == pytest.approx(place, abs=1e-9)


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="tools/test installs liburdfdom-tools")
def test_ros_own_parser_takes_the_urdf(root, robot):
    path = root / f"models/{STEMS[robot]}.urdf"
    said = subprocess.run(["check_urdf", path], capture_output=True, text=True, check=False)
    assert said.returncode == 0 and "Successfully Parsed XML" in said.stdout + said.stderr, said.stderr
    assert "root Link: base_link has 2 child(ren)" in said.stdout


def urdf(root, robot):
    yourdfpy = pytest.importorskip("yourdfpy", reason=OPTIONAL)
    loaded = yourdfpy.URDF.load(str(root / f"models/{STEMS[robot]}.urdf"))
    assert loaded.validate(), loaded.errors
    return loaded


def test_masses_inertias_and_places_are_those_of_the_configuration(root, robot, configured):
    loaded = urdf(root, robot)
    inertial = {name: link.inertial for name, link in loaded.link_map.items() if link.inertial}
    body = inertial["robot"]
    assert body.mass == configured["body_mass_kg"]
    assert body.origin[:3, 3] == pytest.approx([0, 0, configured["com_height_m"]])
    # 0.2 %: [T] Table 3.2's largest moment exceeds the sum of the others, which no body's does.
    assert np.diag(body.inertia) == pytest.approx(configured["body_inertia_kg_m2"], rel=0.002)
    assert np.array_equal(body.inertia, np.diag(np.diag(body.inertia)))
    if robot == "mbbr":
        assert inertial["ball"].mass == configured["ball_mass_kg"]
        assert np.diag(inertial["ball"].inertia) == pytest.approx([configured["ball_inertia_kg_m2"]] * 3)
        masses = configured["body_mass_kg"] + configured["ball_mass_kg"]
    else:
        for wheel in ("left", "right"):
            assert inertial[wheel].mass == configured["wheel_mass_kg"]
            about_axle, *others = np.diag(inertial[wheel].inertia)
            assert others == pytest.approx(configured["wheel_inertia_kg_m2"][1:])
            assert about_axle == pytest.approx(sum(others))  # at most; the configured one has the rotor in it
        masses = configured["body_mass_kg"] + 2 * configured["wheel_mass_kg"]
    assert sum(i.mass for i in inertial.values()) == pytest.approx(masses, abs=1e-5)
    assert loaded.get_transform("imu_link", "robot")[:3, 3] == pytest.approx(
        configured["imu_position_m"], abs=1e-9
    )


def test_axes_of_ros_and_of_the_joints(root, robot, configured):
    """REP 103: x forward, y left, z up; the left wheel is at +y, and both turn forward about +y."""
    loaded = urdf(root, robot)
    axes = {
        name: loaded.get_transform(joint.child, "base_link")[:3, :3] @ joint.axis
        for name, joint in loaded.joint_map.items()
        if joint.type == "continuous"
    }
    places = {
        name: loaded.get_transform(name, "base_link")[:3, 3] for name in axes if name in loaded.link_map
    }
    assert np.allclose(loaded.get_transform("imu_link", "base_link")[:3, :3], np.eye(3))
    if robot == "mip":
        assert places["left"] == pytest.approx([0, configured["track_m"] / 2, 0], abs=1e-9)
        assert places["right"] == pytest.approx([0, -configured["track_m"] / 2, 0], abs=1e-9)
        assert axes["left"] == pytest.approx([0, 1, 0], abs=1e-9) and axes["right"] == pytest.approx(
            [0, 1, 0], abs=1e-9
        )
    else:
        wheels = np.array([axes[f"wheel_{i}"] for i in (1, 2, 3)])
        assert np.allclose(wheels @ wheels.T, np.eye(3))  # wheel_tilt_deg = "orthogonal"
        reach = configured["ball_radius_m"] + configured["wheel_radius_m"]
        for i, name in enumerate(("wheel_1", "wheel_2", "wheel_3")):
            around = np.radians(configured["wheel_azimuth_deg"] + 180.0 + 120.0 * i)
            north = np.radians(configured["wheel_latitude_deg"])
            away = np.array([np.sin(north) * np.cos(around), np.sin(north) * np.sin(around), np.cos(north)])
            assert places[name] == pytest.approx(reach * away, abs=1e-9)
            assert places[name] @ axes[name] == pytest.approx(0.0, abs=1e-9)  # the axle lies along the ball
        for axis, unit in zip("xyz", np.eye(3), strict=True):
            assert axes[f"ball_about_{axis}"] == pytest.approx(unit, abs=1e-9)


def test_the_bodys_mesh_is_seen_and_weighs_nothing(root, robot, configured):
    shown = urdf(root, robot)
    shapes = [geometry.extents for geometry in shown.scene.geometry.values()]
    mesh = trimesh_of(root, robot).extents * 1e-3
    assert any(extents == pytest.approx(mesh, rel=1e-5) for extents in shapes), shapes
    assert shown.scene.extents[2] < configured["com_height_m"] * 3  # millimetres would be a thousand times
    model, _ = compiled(root / f"models/{STEMS[robot]}.xml")
    assert model.nmesh == 1
    geom = next(i for i in range(model.ngeom) if model.geom_dataid[i] == 0)
    assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0
    assert model.body_mass[model.body("robot").id] == pytest.approx(configured["body_mass_kg"])


def trimesh_of(root, robot):
    trimesh = pytest.importorskip("trimesh", reason=OPTIONAL)
    return trimesh.load(root / f"models/{STEMS[robot]}.stl")


def test_the_committed_mesh_is_the_configured_body(root, robot):
    body = pytest.importorskip("equipoise_robot.body", reason=OPTIONAL)
    made, committed = body.mesh(body.looks(body.assemble(robot))), trimesh_of(root, robot)
    assert committed.is_watertight
    for what in ("bounds", "volume", "moment_inertia"):
        was = getattr(committed, what)
        assert was == pytest.approx(
            getattr(made, what), rel=1e-3, abs=1e-5 * np.abs(was).max()
        ), "run build/venv/bin/python -m equipoise_robot.models"


def compiled(path):
    """By MuJoCo, free; it merges what is fixed."""
    mujoco = pytest.importorskip("mujoco", reason=OPTIONAL)
    spec = mujoco.MjSpec.from_file(str(path))
    if not any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints):
        spec.compiler.fusestatic = False
        spec.body("base_link").add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for unit, row in zip(np.eye(model.nv), mass, strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return model, mass


def test_mujoco_makes_the_same_robot_of_both(root, robot):
    """Upright: the same mass matrix, in the axes of ROS where it is the URDF's."""
    of_mjcf, mass = compiled(root / f"models/{STEMS[robot]}.xml")
    of_urdf, other = compiled(root / f"models/{STEMS[robot]}.urdf")
    if robot == "mbbr":
        joints = [of_urdf.joint(f"ball_about_{axis}").dofadr[0] for axis in "xyz"]
    else:
        joints = [of_urdf.joint(name).dofadr[0] for name in ("right", "left")]
    turned = models.R_FB[robot]
    n = 6 + len(joints)
    assert mass.shape == (n, n)
    into = np.eye(n)
    into[:3, :3] = into[3:6, 3:6] = turned
    kept = [*range(6), *joints]
    expected = into @ mass @ into.T
    if robot == "mbbr":  # a URDF has no armature
        expected[6:, 6:] -= np.diag(of_mjcf.dof_armature[6:])
    assert other[np.ix_(kept, kept)] == pytest.approx(expected, rel=1e-3, abs=2e-6)
