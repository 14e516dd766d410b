"""import and replay --shadow: a foreign table as a log, its mistakes by name, the firmware beside it."""

import io
import json
import re
import subprocess
import sys
import tomllib

import equipoise as types
import numpy as np
import pandas as pd
import pytest
from driven import rewritten
from equipoise_robot import Log
from equipoise_tools.paths import binary
from scipy.io import savemat
from scipy.spatial.transform import Rotation

import lcm

# The chip's axes: body x, z, -y; the board stands upright.
COLUMNS = {
    "gyro": ["gx", "gy", "gz"],
    "accel": ["ax", "ay", "az"],
    "wheels": ["e0", "e1"],
    "drive": ["d0", "d1"],
}
UNITS = {"gyro": "deg/s", "accel": "g", "wheels": "rad"}
SAMPLES = {f"sensors.{a}_counts_{i}": f"{a[0]}{'xyz'[i]}" for a in ("gyro", "accel") for i in range(3)}


def run(*arguments, status=0):
    command = [str(binary()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    return done


def write_map(path, robot, time="column", **changes):
    columns, units = COLUMNS | changes.get("columns", {}), UNITS | changes.get("units", {})
    axes = {name: json.dumps(names) for name, names in columns.items()}
    path.write_text(
        f'robot = "{robot}"\n[time]\n{time} = "t"\nunit = "s"\n[[balancing]]\nfrom_s = 0.5\nto_s = 30\n'
        f'[gyro]\naxes = {axes["gyro"]}\nunit = "{units["gyro"]}"\n'
        f'[accel]\naxes = {axes["accel"]}\nunit = "{units["accel"]}"\n'
        f'[wheels]\nkind = "angle"\naxes = {axes["wheels"]}\nunit = "{units["wheels"]}"\n'
        f'[drive]\nkind = "duty"\naxes = {axes["drive"]}\nunit = "1"\n[battery]\ncolumn = "v"\nunit = "V"\n'
    )
    return path


def foreign(folder, config, pushes, counts_per_rev):
    """20 s of a simulated robot, driving, turning and pushed, as somebody else's CSV."""
    log = folder / "sim.lcm"
    told = ", ".join(f"{{at_s={t}, duration_s=0.05, force_N=[{x}, {y}]}}" for t, x, y in pushes)
    run("sim", "--config", config, "--fidelity", "nominal", "--duration-s", 20,
        "--yaw-hz", 0.3, "--drive-mps", 0.1, "--telemetry", "off", "--log", log,
        "--set", f"world.nominal.pushes=[{told}]")  # fmt: skip
    run("convert", log, "--to", "csv")
    ours = pd.read_csv(log.with_suffix(".csv"))
    out = ours[list(SAMPLES)].rename(columns=SAMPLES)
    out[["gx", "gy", "gz"]] /= 16.4
    out[["ax", "ay", "az"]] /= 4096
    out.insert(0, "t", ours["t_s"])
    for i, counts in enumerate(counts_per_rev):
        out[f"e{i}"] = ours[f"sensors.encoder_counts_{i}"] * 2 * np.pi / counts
        out[f"d{i}"] = ours[f"motors.duty_{i}"]
    out["v"] = ours["health.battery_V"]
    out.to_csv(folder / "theirs.csv", index=False)
    return folder / "theirs.csv"


@pytest.fixture(scope="module")
def table(root, tmp_path_factory):
    pushes = [(t, 0.0, 1.0) for t in range(3, 18, 2)]
    return foreign(tmp_path_factory.mktemp("foreign"), root / "config/edumip.toml", pushes, [2134.62] * 2)


def checks(table, map_file):
    log = table.with_suffix(".lcm")
    done = run("import", table, "--map", map_file, "-o", log, "--json", "-")
    out = json.loads(done.stdout)  # nothing else on stdout
    return out | {"log": log, "by_name": {c["name"]: c for c in out["checks"]}}


def test_a_table_becomes_a_log_that_everything_reads(root, table, tmp_path):
    out = checks(table, write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    assert out["checks_failed"] == []
    told = [name for name, c in out["by_name"].items() if c["ok"]]
    assert {"gyro_x_accel", "wheels_accel", "drive_wheels", "gyro_z_wheels"} <= set(told)
    log = Log(out["log"])
    original = Log(table.parent / "sim.lcm")
    assert len(log.sensors()) == len(original.sensors())
    np.testing.assert_allclose(log.sensors()["gyro_B_rad_s"], original.sensors()["gyro_B_rad_s"], atol=1e-9)
    of = [tomllib.loads(each.run.config_toml) for each in (log, original)]
    assert of[0]["robot"] == of[1]["robot"]
    events = {event.channel: event for event in lcm.EventLog(str(out["log"]))}
    end = types.verdict_t.decode(events["EQUIPOISE_VERDICT"].data)
    assert end.duration_s == pytest.approx(len(log.sensors()) / 200) and np.isnan(end.fell_at_s)
    channels = set(events)
    assert {"EQUIPOISE_RUN", "EQUIPOISE_SENSORS", "EQUIPOISE_MOTORS"} <= channels
    run("convert", out["log"], "--to", "mcap", "--out", tmp_path / "a.mcap")
    assert "--shadow" in run("replay", out["log"], status=2).stderr


@pytest.mark.parametrize(
    ("changes", "check", "named"),
    [
        ({"units": {"gyro": "rad/s"}}, "gyro_z_wheels", "gyro.unit is deg/s, not rad/s"),
        ({"units": {"accel": "m/s2"}}, "accel_norm", "accel.unit is g, not m/s2"),
        ({"units": {"wheels": "deg"}}, "drive_wheels", "wheels.unit is wrong"),
        ({"columns": {"gyro": ["-gx", "gy", "gz"]}}, "gyro_x_accel", "gyro x is flipped"),
        ({"columns": {"gyro": ["gx", "-gy", "gz"]}}, "gyro_z_wheels", "gyro z is flipped"),
        ({"columns": {"accel": ["ax", "ay", "-az"]}}, "gyro_x_accel", "accel y is flipped"),
        ({"columns": {"accel": ["ax", "-ay", "az"]}}, "accel_up", "accel z is flipped"),
        ({"columns": {"wheels": ["e1", "e0"]}}, "gyro_z_wheels", "the wheels are swapped"),
        ({"columns": {"drive": ["d1", "d0"]}}, "drive_wheels_turn", "the drive's columns are swapped"),
        ({"columns": {"drive": ["-d0", "-d1"]}}, "drive_wheels", "the sign of drive or wheels is flipped"),
        ({"units": {"wheels": "rev"}}, "drive_wheels", "drive.unit, drive.kind or wheels.unit is wrong"),
        ({"units": {"wheels": "rev"}}, "gyro_z_wheels", "wheels.unit is rad, not rev"),
    ],
)
def test_a_mistake_in_the_map_is_named(root, table, tmp_path, changes, check, named):
    out = checks(table, write_map(tmp_path / "map.toml", root / "config/edumip.toml", **changes))
    assert check in out["checks_failed"]
    assert named in out["by_name"][check]["text"]


def test_a_loop_per_wheel_does_not_make_wheels_that_never_turn_look_swapped(root, table, tmp_path):
    looped = pd.read_csv(table)
    scatter = 0.02 * np.sin(20 * looped.t)  # of the encoders, which their loops answer
    rate = np.gradient(scatter, looped.t)
    both, drive = 0.5 * (looped.e0 + looped.e1), 0.5 * (looped.d0 + looped.d1)
    looped["e0"], looped["e1"] = both + scatter, both - scatter
    looped["d0"], looped["d1"] = drive - 0.02 * rate, drive + 0.02 * rate
    looped["gy"] = 0.0
    looped.to_csv(tmp_path / "looped.csv", index=False)
    out = checks(tmp_path / "looped.csv", write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    assert out["by_name"]["drive_wheels_turn"]["value"] < 0
    assert "drive_wheels_turn" not in out["checks_failed"]
    assert "does not tell" in out["by_name"]["drive_wheels_turn"]["text"]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_loop_that_holds_the_wheels_speed_hides_no_sign_of_the_drive(root, table, tmp_path, sign):
    held = pd.read_csv(table)  # as with the wheels in the air: 20 rad/s, half of the no-load speed
    change = 0.5 * np.sin(10 * held.t)
    for i in range(2):
        held[f"e{i}"] = 20 * held.t - 0.05 * np.cos(10 * held.t)
        held[f"d{i}"] = sign * (0.5 - 0.3 * change)
    held.to_csv(tmp_path / "held.csv", index=False)
    out = checks(tmp_path / "held.csv", write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    assert ("drive_wheels" in out["checks_failed"]) == (sign < 0)


def test_noise_of_the_encoders_is_no_wrong_scale(root, table, tmp_path):
    noisy = pd.read_csv(table)
    noise = np.random.default_rng(5).standard_normal(len(noisy))
    noise = pd.Series(noise).rolling(40, center=True, min_periods=1).mean()  # of the band that is compared
    turn = noisy.e0 - noisy.e1
    turn -= turn.rolling(400, center=True, min_periods=1).mean()
    noise *= 0.08 * turn.std() / noise.std()
    noisy["e0"], noisy["e1"] = noisy.e0 + noise, noisy.e1 - noise
    noisy.to_csv(tmp_path / "noisy.csv", index=False)
    config = root / "config/edumip.toml"
    out = checks(tmp_path / "noisy.csv", write_map(tmp_path / "map.toml", config))
    assert 0 < out["by_name"]["gyro_z_wheels"]["value"] < 1 / 1.4, "what noise leaves of it"
    assert "gyro_z_wheels" not in out["checks_failed"]
    wrong = write_map(tmp_path / "map.toml", config, units={"gyro": "rad/s"})
    assert "gyro.unit is deg/s" in checks(tmp_path / "noisy.csv", wrong)["by_name"]["gyro_z_wheels"]["text"]


def test_an_accelerometer_that_clips_is_no_wrong_channel(root, table, tmp_path):
    shaken = pd.read_csv(table)
    for axis in ("ax", "ay", "az"):
        shaken[axis] = (1.5 * shaken[axis]).clip(-1.48, 1.48)
    shaken.to_csv(tmp_path / "shaken.csv", index=False)
    config = root / "config/edumip.toml"
    out = checks(tmp_path / "shaken.csv", write_map(tmp_path / "map.toml", config))
    assert "accel_clipping" in out["checks_failed"] and "accel_norm" not in out["checks_failed"]
    assert "clips" in out["by_name"]["accel_norm"]["text"]
    wrong = write_map(tmp_path / "map.toml", config, units={"accel": "m/s2"})
    assert "accel.unit is g" in checks(tmp_path / "shaken.csv", wrong)["by_name"]["accel_norm"]["text"]


def test_shadow_of_a_healthy_run_is_quiet_and_of_a_dead_gyro_axis_is_not(root, table, tmp_path):
    out = checks(table, write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    healthy = json.loads(run("replay", out["log"], "--shadow", "--json", "-").stdout)
    assert healthy["judged_s"] > 18
    assert healthy["alarms"] == [] and healthy["alarms_per_min"] == 0
    assert healthy["tilt_std_rad"] < 0.008  # pushes shift the smoother, too
    for ahead in healthy["ahead"].values():
        assert ahead["wheel"] < ahead["persistence"]["wheel"]
    assert set(healthy["nis"]) == {"gyro_x", "gyro_y", "gyro_z", "wheel_1", "wheel_2", "accel_y"}
    wrong = pd.read_csv(table)
    wrong.loc[wrong.t > 10, "gx"] = 0
    wrong.to_csv(tmp_path / "wrong.csv", index=False)
    out = checks(tmp_path / "wrong.csv", tmp_path / "map.toml")
    faulty = json.loads(run("replay", out["log"], "--shadow", "--json", "-").stdout)
    alarm = next(each for each in faulty["alarms"] if each["hypothesis"] == "without_gyro_axis")
    assert 10 < alarm["t_s"] < 10.5, alarm
    unbounded = alarm["ratio"] is None and alarm["bound"] is None  # the detector's verdict
    assert unbounded or alarm["ratio"] > alarm["bound"] > 0, alarm


def test_shadow_finds_the_mount_that_the_configuration_does_not_know(root, table, tmp_path):
    out = checks(table, write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    edumip, config = root / "config/edumip.toml", tmp_path / "mounted.toml"
    board = np.reshape(tomllib.loads(edumip.read_text())["calibration"]["R_BS"], (3, 3))
    mounted = Rotation.from_euler("x", 0.03).as_matrix() @ board
    config.write_text(f'base = "{edumip}"\n[calibration]\nR_BS = {mounted.ravel().tolist()}\n')
    known = json.loads(run("replay", out["log"], "--shadow", "--json", "-").stdout)
    found = json.loads(run("replay", out["log"], "--shadow", "--config", config, "--json", "-").stdout)
    assert found["mount_rad"][0] - known["mount_rad"][0] == pytest.approx(0.03, abs=0.001)
    assert abs(found["tilt_offset_rad"]) < 0.001
    assert found["tilt_std_rad"] == pytest.approx(known["tilt_std_rad"], abs=2e-4)


def test_shadow_waits_until_the_robot_stands(root, table, tmp_path):
    lying = pd.read_csv(table)  # for three seconds, then raised by hand
    angle = 1.2 * np.clip(4.0 - lying.t, 0.0, 1.0)
    for sensor in "ga":
        up, back = lying[f"{sensor}y"].copy(), -lying[f"{sensor}z"]
        lying[f"{sensor}y"] = np.cos(angle) * up - np.sin(angle) * back
        lying[f"{sensor}z"] = -(np.cos(angle) * back + np.sin(angle) * up)
    lying.gx += np.rad2deg(np.gradient(angle, lying.t))
    down = lying.t < 3
    lying.to_csv(tmp_path / "lying.csv", index=False)
    out = checks(tmp_path / "lying.csv", write_map(tmp_path / "map.toml", root / "config/edumip.toml"))
    shadow = json.loads(run("replay", out["log"], "--shadow", "--json", "-").stdout)
    assert 14 < shadow["judged_s"] < 17 and shadow["alarms"] == []
    lying[down].to_csv(tmp_path / "down.csv", index=False)
    run("import", tmp_path / "down.csv", "--map", tmp_path / "map.toml", "-o", tmp_path / "down.lcm")
    told = run("replay", tmp_path / "down.lcm", "--shadow").stdout
    assert "judged 0.00 s" in told and "not armed: tilt" in told


def test_shadow_runs_on_our_own_logs_of_both_robots(root, tmp_path):
    log = tmp_path / "ball.lcm"
    run("sim", "--config", root / "config/mbbr.toml", "--duration-s", 8, "--yaw-hz", 1, "--drive-mps", 0.1,
        "--telemetry", "off", "--log", log)  # fmt: skip
    out = json.loads(run("replay", log, "--shadow", "--json", "-").stdout)
    assert out["judged_s"] > 7 and out["alarms"] == []
    assert out["tilt_std_rad"] < 0.005
    assert out["ahead"]["100ms"]["wheel"] < out["ahead"]["100ms"]["persistence"]["wheel"]
    other = run("replay", log, "--shadow", "--config", root / "config/edumip.toml", status=2)
    assert "robot of type mip, the log of mbbr" in other.stderr


def test_a_stretch_too_short_for_the_smoother_is_said_to_be(root, table, tmp_path):
    short = write_map(tmp_path / "map.toml", root / "config/edumip.toml")
    short.write_text(short.read_text().replace("from_s = 0.5\nto_s = 30", "from_s = 2.0\nto_s = 2.4"))
    run("import", table, "--map", short, "-o", tmp_path / "a.lcm")
    told = run("replay", tmp_path / "a.lcm", "--shadow").stdout
    assert "against the smoother: no stretch is longer" in told and "nan" not in told


def test_errors_name_the_key_and_the_fix(root, table, tmp_path):
    good = write_map(tmp_path / "map.toml", root / "config/edumip.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text(good.read_text().replace('"gx"', '"gyro"'))
    assert 'no column "gyro"' in run("import", table, "--map", bad, "-o", tmp_path / "a.lcm", status=2).stderr
    bad.write_text(good.read_text().replace('unit = "deg/s"', 'unit = "dps"'))
    assert "gyro.unit" in run("import", table, "--map", bad, "-o", tmp_path / "a.lcm", status=2).stderr
    bad.write_text(re.sub(r"\[gyro\]\n.*\n.*\n", "", good.read_text()))
    told = run("import", table, "--map", bad, "-o", tmp_path / "a.lcm", status=2).stderr
    assert f"has no [gyro]; a log without raw gyro: ./tools/lab identify TABLE --map {bad}" in told
    far = pd.read_csv(table)
    far.loc[far.index[-1], "t"] = 3e7
    far.to_csv(tmp_path / "far.csv", index=False)
    said = run("import", tmp_path / "far.csv", "--map", good, "-o", tmp_path / "a.lcm", status=2).stderr
    assert "two hours are the most" in said and said.count("\n") == 1
    matlab = tmp_path / "a.mat"
    matlab.write_bytes(b"MATLAB 5.0")
    assert "./tools/table" in run("import", matlab, "--map", good, "-o", tmp_path / "a.lcm", status=2).stderr


def test_binary_tables_become_csv(tmp_path):
    t = np.arange(5.0)
    content = {"data": {"time": t, "values": np.column_stack([t, -t])}, "note": "x", "short": np.arange(3.0)}
    savemat(tmp_path / "a.mat", content)
    pd.DataFrame({"t": t, "u": 2 * t}).to_parquet(tmp_path / "a.parquet")

    def table(name, status=0):
        command = [sys.executable, "-m", "equipoise_tools.table", str(tmp_path / name)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        return done

    done = table("a.mat")
    written = pd.read_csv(io.StringIO(done.stdout))
    assert list(written) == ["data.time", "data.values_1", "data.values_2"]
    np.testing.assert_array_equal(written["data.values_2"], -t)
    assert "short has 3 values, not 5" in done.stderr
    assert list(pd.read_csv(io.StringIO(table("a.parquet").stdout))) == ["t", "u"]
    assert "there is no such file" in table("gone.mat", 2).stderr
    (tmp_path / "a.xlsx").touch()
    assert "is none of .mat" in table("a.xlsx", 2).stderr


BALL = {"wheels": ["e0", "e1", "e2"], "drive": ["d0", "d1", "d2"], "gyro": ["gx", "gy", "gz"]}
BALL |= {"accel": ["ax", "ay", "az"]}


@pytest.fixture(scope="module")
def ball_table(root, tmp_path_factory):
    """Pushed along both axes in turn."""
    pushes = [(t, float(t % 4 == 1), float(t % 4 == 3)) for t in range(3, 18, 2)]
    return foreign(tmp_path_factory.mktemp("ball"), root / "config/mbbr.toml", pushes, [720] * 3)


@pytest.mark.parametrize(
    ("columns", "azimuth", "check", "named"),
    [
        ({}, -140, None, ""),
        (
            {"wheels": ["e1", "e0", "e2"]},
            -140,
            "wheel_order",
            "columns are wheels 2, 1, 3 of the configuration",
        ),
        (
            {"wheels": ["e1", "e2", "e0"]},
            -140,
            "wheel_order",
            "2, 3, 1 of the configuration, or robot.wheel_azimuth",
        ),
        ({"wheels": ["e0", "-e1", "e2"]}, -140, "wheel_order", "the sign of column 2 is flipped"),
        ({}, -100, "wheel_order", "robot.wheel_azimuth_deg is off: add -4"),
        ({}, 40, "wheel_order", "robot.wheel_azimuth_deg is off: add 17"),
        ({"gyro": ["gx", "gy", "-gz"]}, -140, "wheel_order", "gyro z is flipped"),
        ({"drive": ["d1", "d0", "d2"]}, -140, "drive_wheels_y", "the sign of drive or wheels is flipped"),
    ],
)
def test_wheel_order_and_azimuth_of_a_ball_bot_are_named(
    root, ball_table, tmp_path, columns, azimuth, check, named
):
    config = tmp_path / "ball.toml"
    text = (root / "config/mbbr.toml").read_text()
    config.write_text(text.replace("wheel_azimuth_deg = -140.0", f"wheel_azimuth_deg = {azimuth}"))
    out = checks(ball_table, write_map(tmp_path / "map.toml", config, columns=BALL | columns))
    if check is None:
        assert out["checks_failed"] == [] and out["by_name"]["wheel_order"]["ok"]
        assert out["by_name"]["drive_wheels"]["ok"] and out["by_name"]["drive_wheels_y"]["ok"]
    else:
        assert check in out["checks_failed"]
        assert named in out["by_name"][check]["text"]


def test_samples_that_are_none_are_no_noise(root, log, tmp_path):
    """Every fiftieth sample is invalid and nonsense: the noise is that of the others."""
    ticks = iter(range(10**9))

    def spoil(message):
        if type(message).__name__ == "sensors_t" and next(ticks) % 50 == 49:
            message.valid &= ~1
            message.gyro_counts, message.accel_counts = [9e3] * 3, [9e3] * 3

    spoiled = rewritten(tmp_path / "spoiled.lcm", log, spoil)
    noise = [
        json.loads(run("replay", each, "--shadow", "--json", "-").stdout)["noise"] for each in (log, spoiled)
    ]
    for of in noise[0]:
        assert noise[1][of]["log"] == pytest.approx(noise[0][of]["log"], rel=0.2), of
