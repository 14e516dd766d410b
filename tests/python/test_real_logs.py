"""Logs of real robots through import and shadow: what is right passes, what is wrong has its name."""

import itertools
import json
import re

import numpy as np
import pytest
from driven import CONFIGS, equipoise, real_log, real_logs, rewritten
from equipoise_tools import noise_comparison
from equipoise_tools.foreign_log import configuration


@pytest.mark.parametrize("name", ["mini_segway_log278", "regbot_bal_log_1", "regbot_bal_log_2"])
def test_real_logs_pass_their_checks(root, tmp_path, name):
    map_file = root / f"config/real/maps/{name}.toml"
    table, log = real_log(root, map_file), tmp_path / "real.lcm"
    out = json.loads(equipoise(root, "import", table, "--map", map_file, "-o", log, "--json", "-").stdout)
    assert not {"gyro_x_accel", "wheels_accel", "drive_wheels", "gyro_z_wheels", "accel_up"} & set(
        out["checks_failed"]
    )
    shadow = json.loads(equipoise(root, "replay", log, "--shadow", "--json", "-").stdout)
    assert shadow["judged_s"] > 1
    assert shadow["alarms"] == []
    ahead = shadow["ahead"]["100ms"]
    assert ahead["wheel"] < min(ahead[other]["wheel"] for other in ("persistence", "constant_rate"))
    assert shadow["tilt_std_rad"] < (0.003 if name == "mini_segway_log278" else 0.008)
    if name == "mini_segway_log278":
        assert ahead["tilt"] < min(ahead[other]["tilt"] for other in ("persistence", "constant_rate"))
    if name == "regbot_bal_log_2":
        assert all(0.5 < nis < 2 for nis in shadow["nis"].values()), shadow["nis"]


@pytest.mark.parametrize("name", ["mini_segway_log278", "regbot_bal_log_1", "regbot_bal_log_2"])
def test_real_logs_are_quiet_wherever_the_shadow_starts(root, tmp_path, name):
    original = root / f"config/real/maps/{name}.toml"
    table = real_log(root, original)
    for later in range(-35, 125, 20):
        text = re.sub(
            r"(?<=\[\[balancing\]\]\nfrom_s = )[\d.]+",
            lambda start, later=later: f"{float(start[0]) + 1e-3 * later:.3f}",
            original.read_text(),
        )
        (tmp_path / "map.toml").write_text(text.replace('"../', f'"{root}/config/real/'))
        equipoise(root, "import", table, "--map", tmp_path / "map.toml", "-o", tmp_path / "real.lcm")
        shadow = json.loads(
            equipoise(root, "replay", tmp_path / "real.lcm", "--shadow", "--json", "-").stdout
        )
        assert shadow["judged_s"] > 1
        assert shadow["alarms"] == [], later


# REGBOT held, let go or caught: outside of any envelope, but its columns are what the map says.
HELD = {
    "ballance_only_13": "t n ax ay az gx gy gz r0 r1 v0 v1 w0 w1 b n1 n2 n3 n4",
    "ballance_only_13_free": "t n ax ay az gx gy gz r0 r1 v0 v1 w0 w1 b n1 n2 n3 n4",
    "b1/tilt_log": "t ax ay az gx gy gz v0 v1 w0 w1 x y h tilt",
}


@pytest.mark.parametrize("name", HELD)
@pytest.mark.parametrize("wrong", ["", "drive", "wheels"])
def test_a_real_robot_that_does_not_balance_names_what_is_wrong_and_nothing_else(root, tmp_path, name, wrong):
    table = real_logs(root) / f"SebastianBitsch+robobot-project/regbot/matlab/mekanisk/{name}.txt"
    if not table.exists():
        pytest.skip(f"no {table}: docs/reality.md says where such logs are from")
    minus = {what: "-" if what == wrong else "" for what in ("drive", "wheels")}
    map_file = tmp_path / "map.toml"
    map_file.write_text(
        f'robot = "{root}/config/real/regbot.toml"\n[table]\ncolumns = {json.dumps(HELD[name].split())}\n'
        '[time]\ncolumn = "t"\nunit = "s"\n[gyro]\naxes = ["-gy", "-gx", "-gz"]\nunit = "deg/s"\n'
        '[accel]\naxes = ["-ay", "-ax", "-az"]\nunit = "m/s2"\n[wheels]\nkind = "rate"\nunit = "rad/s"\n'
        f'axes = ["{minus["wheels"]}w1", "{minus["wheels"]}w0"]\n[battery]\nvolts = 12\n'
        '[drive]\nkind = "volts"\n'
        f'axes = ["{minus["drive"]}v1", "{minus["drive"]}v0"]\nunit = "V"\n'
    )
    out = json.loads(
        equipoise(root, "import", table, "--map", map_file, "-o", tmp_path / "a.lcm", "--json", "-").stdout
    )
    failed = set(out["checks_failed"]) - {"gyro_clipping", "accel_clipping"}
    if not wrong:
        assert failed == set()
    else:
        assert "drive_wheels" in failed


@pytest.fixture(scope="module")
def driven_for_20_s(root, robot, tmp_path_factory):
    config, path = root / f"config/{CONFIGS[robot]}.toml", tmp_path_factory.mktemp("driven") / "run.lcm"
    how = ["--duration-s", 20, "--drive-mps", 0.1, "--yaw-hz", 0.3, "--telemetry", "off", "--log", path]
    assert equipoise(root, "sim", "--config", config, "--fidelity", "nominal", *how).returncode == 0
    return path, configuration(config)["calibration"]


@pytest.mark.parametrize("name", noise_comparison.MOTIONS)
def test_what_shakes_a_real_robot_is_no_fault_of_a_simulated_one(root, driven_for_20_s, tmp_path, name):
    healthy, calibration = driven_for_20_s
    map_file, binary = root / f"config/real/maps/{name}.toml", root / "build/host/equipoise"
    _, motions = noise_comparison.real_motions(binary, real_log(root, map_file), map_file)
    axes = np.reshape(calibration["R_BS"], (3, 3))
    counts = [np.degrees(calibration["gyro_counts_per_deg_s"]), calibration["accel_counts_per_g"] / 9.81]
    for motion, samples in motions.items():
        shaking = noise_comparison.high_passed(samples)
        gyro, accel = (k * shaking[:, at : at + 3] @ axes for k, at in zip(counts, (0, 3), strict=True))
        rows = itertools.cycle(zip(gyro, accel, strict=True))

        def shaken(message, rows=rows):
            if type(message).__name__ == "sensors_t":
                gyro, accel = next(rows)
                message.gyro_counts = list(np.round(message.gyro_counts + gyro))
                message.accel_counts = list(np.round(message.accel_counts + accel))

        log = rewritten(tmp_path / f"{motion}.lcm", healthy, shaken)
        shadow = json.loads(equipoise(root, "replay", log, "--shadow", "--json", "-").stdout)
        assert shadow["judged_s"] > 18
        assert shadow["alarms"] == [], motion
