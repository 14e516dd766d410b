"""Our attitude filter beside PyPI's vqf on the same IMU data: both robots balancing, and general motion."""

import json
import os
import subprocess

import numpy as np
import pytest
import vqf
from equipoise_robot.log import read_log
from equipoise_tools import names
from scipy.spatial.transform import Rotation

RATE_HZ = 200.0
SETTLED = int(5 * RATE_HZ)
GYRO = np.pi / 180 / 16.4
ACCEL = 9.8 / 4096
ROBOTS = {
    "mip": ("config/edumip.toml", [[1, 0, 0], [0, 0, -1], [0, 1, 0]], (0.0, 0.016, 0.046)),
    "mbbr": ("config/mbbr.toml", np.eye(3).tolist(), (0.0, 0.0, 0.130)),
}
YAW_RAD_S = {"mip": (0, 5, 10), "mbbr": (0, 2 * np.pi)}


@pytest.fixture(scope="module")
def binary(root):
    path = root / "build" / "host" / "equipoise"
    path = type(path)(os.environ.get("EQUIPOISE_BINARY", path))
    if not path.exists():
        pytest.skip("equipoise is not built")
    return path


def inclination_rmse(up_B: np.ndarray, true_up_B: np.ndarray) -> float:
    """Angle between estimated and true vertical in body axes: heading does not enter."""
    cosine = np.clip(np.sum(up_B * true_up_B, axis=1), -1, 1)
    sine = np.linalg.norm(np.cross(up_B, true_up_B), axis=1)
    return float(np.sqrt(np.mean(np.arctan2(sine, cosine)[SETTLED:] ** 2)))


def ups(quaternion_wxyz: np.ndarray) -> np.ndarray:
    rotation = Rotation.from_quat(np.roll(quaternion_wxyz, -1, axis=1))
    return rotation.inv().apply([0, 0, 1])


def ours(binary, tmp_path, gyro, accel, arm=(0, 0, 0)) -> np.ndarray:
    rows = [{"gyro_rad_s": g, "accel_m_s2": a} for g, a in zip(gyro.tolist(), accel.tolist(), strict=True)]
    file = tmp_path / "imu.json"
    file.write_text(json.dumps({"rows": rows}))
    command = [binary, "attitude", "--in", file, "--lever-arm-m", *map(str, arm), "--json", "-"]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return ups(np.array([row["q_wxyz"] for row in json.loads(out)["rows"]]))


def theirs(gyro, accel) -> np.ndarray:
    batch = vqf.VQF(1 / RATE_HZ).updateBatch(np.ascontiguousarray(gyro), np.ascontiguousarray(accel))
    return ups(batch["quat6D"])


def simulated(root, binary, folder, robot, yaw, seed):
    """Gyro and specific force in body axes, and the true vertical, of 40 s in the nominal world."""
    config, R_BS, _ = ROBOTS[robot]
    log_path = folder / "run.lcm"
    command = [binary, "sim", "--config", config, "--yaw-rad-s", str(yaw), "--duration-s", "40"]
    command += ["--seed", str(seed), "--fidelity", "nominal", "--telemetry", "off", "--log", log_path]
    subprocess.run(command, cwd=root, capture_output=True, check=True)
    log = read_log(log_path)
    sensors, truth = log[names.SENSORS], log[names.TRUTH]
    gyro = GYRO * np.asarray(sensors["gyro_counts"]) @ np.array(R_BS).T
    force = ACCEL * np.asarray(sensors["accel_counts"]) @ np.array(R_BS).T
    true_up = Rotation.from_euler("xyz", truth["theta_rad"]).inv().apply([0, 0, 1])
    if yaw == 0:  # the accelerometer's bias, which no filter sees, would decide: it is calibrated
        force -= (force - 9.8 * true_up)[SETTLED:].mean(axis=0)
    return gyro, force, true_up


@pytest.mark.parametrize(("robot", "yaw"), [(r, w) for r, all_w in YAW_RAD_S.items() for w in all_w])
def test_not_worse_than_vqf_while_balancing(root, binary, tmp_path, robot, yaw):
    """Over twelve robots: of four on a floor that shakes either filter may be ahead by chance."""
    squares = []
    for seed in range(1, 13):
        gyro, force, true_up = simulated(root, binary, tmp_path, robot, yaw, seed)
        mine = ours(binary, tmp_path, gyro, force, ROBOTS[robot][2])
        squares.append([inclination_rmse(up, true_up) ** 2 for up in (mine, theirs(gyro, force))])
    our_rmse, their_rmse = np.sqrt(np.mean(squares, axis=0))
    print(f"{robot} {yaw:.1f} rad/s: ours {our_rmse:.5f}, vqf {their_rmse:.5f} rad")
    assert our_rmse <= their_rmse


def general_motion(seed: int, rate_scale: float, accel_scale: float):
    """Smooth random rotation and acceleration, with noise and gyro bias; two seconds of rest first."""
    random = np.random.default_rng(seed)
    n = int(60 * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    moving = np.clip((t - 2) / 1, 0, 1)[:, None]

    def smooth(scale):
        frequencies = random.uniform(0.1, 1.5, (6, 3))
        phases = random.uniform(0, 2 * np.pi, (6, 3))
        waves = np.sin(2 * np.pi * t[:, None, None] * frequencies + phases)
        return moving * scale * waves.sum(axis=1) / np.sqrt(6)

    omega = smooth(rate_scale)
    acceleration_W = smooth(accel_scale)
    rotations = [Rotation.from_euler("xyz", random.uniform(-0.5, 0.5, 3))]
    for step in Rotation.from_rotvec(omega[1:] / RATE_HZ):
        rotations.append(rotations[-1] * step)
    rotation = Rotation.concatenate(rotations)
    force = rotation.inv().apply(acceleration_W + np.array([0, 0, 9.8]))
    gyro = omega + random.normal(0, 0.005, 3) + random.normal(0, 0.0015, (n, 3))
    return gyro, force + random.normal(0, 0.1, (n, 3)), rotation.inv().apply([0, 0, 1])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("rate", "accel"), [(0.5, 0.5), (2.0, 2.0), (4.0, 4.0)])
def test_close_to_vqf_on_general_motion(binary, tmp_path, seed, rate, accel):
    gyro, force, true_up = general_motion(seed, rate, accel)
    our_rmse = inclination_rmse(ours(binary, tmp_path, gyro, force), true_up)
    their_rmse = inclination_rmse(theirs(gyro, force), true_up)
    print(f"seed {seed}, {rate} rad/s, {accel} m/s^2: ours {our_rmse:.5f}, vqf {their_rmse:.5f} rad")
    assert our_rmse <= 1.2 * their_rmse
