"""equipoise identify: parameters out of bench logs, fragments for a configuration, clear refusals."""

import json
import shutil
import subprocess
import tomllib

import numpy as np
import pandas as pd
import pytest
from driven import real_logs
from equipoise_tools.paths import binary, repository_root
from equipoise_tools.table import matlab
from scipy.signal import lfilter

# [T] Table 4.3, motor 1; the driver's switches (DRV8871) are in series with the winding.
RESISTANCE, SWITCHES, TORQUE_CONSTANT, INDUCTANCE = 6.49, 0.565, 0.133, 0.362e-3
BENCH = ("motor-bench", "--motor", "1", "--driver", "1", "--pwm-hz", "20000", "--json", "-")


def run(*arguments, status=0):
    command = [str(binary()), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    return done


@pytest.fixture(scope="module")
def brake_log(tmp_path_factory):
    log = tmp_path_factory.mktemp("bench") / "brake.lcm"
    run(*BENCH, "--mode", "drive_brake", "--log", log)
    return log


def test_motor_parameters_come_back_and_a_configuration_includes_them(brake_log, tmp_path):
    fragment = tmp_path / "motor.toml"
    done = run("identify", "motor", brake_log, "--inertia-kg-m2", 2e-3, "--out", fragment, "--json", "-")
    found = json.loads(done.stdout)["estimates"]  # nothing else on stdout
    assert found["resistance_ohm"]["value"] == pytest.approx(RESISTANCE + SWITCHES, rel=0.02)
    assert found["torque_constant_N_m_A"]["value"] == pytest.approx(TORQUE_CONSTANT, rel=0.02)
    assert found["coulomb_friction_N_m"]["value"] == pytest.approx(0.004, rel=0.02)
    assert not found["inductance_H"]["determined"]  # 55 us against samples of 5 ms
    text = fragment.read_text()
    assert "# inductance_H: the data do not determine it" in text
    assert 'beside this file: include = ["motor.toml"]\n' in text
    beside = tmp_path / "mbbr.toml"
    shutil.copy(repository_root() / "config/mbbr.toml", beside)
    include = 'include=["motor.toml"]'
    simulated = run("sim", "--config", beside, "--set", include, "--duration-s", 0.1, "--log",
                 tmp_path / "a.lcm", "--telemetry", "off", "--json", "-", status=0)  # fmt: skip
    plain = run("sim", "--config", "config/mbbr.toml", "--duration-s", 0.1, "--log",
                tmp_path / "b.lcm", "--telemetry", "off", "--json", "-", status=0)  # fmt: skip
    sha = [json.loads(each.stdout)["config_sha256"] for each in (simulated, plain)]
    assert sha[0] != sha[1]


def test_a_seed_is_another_bench():
    first, again, other = (
        json.loads(run(*BENCH, "--mode", "drive_brake", "--seed", seed).stdout)["rows"] for seed in (1, 1, 2)
    )
    assert first == again != other


def changed_log(brake_log_csv, tmp_path, change):
    """The simulated bench's log as another sensor would have it."""
    table = pd.read_csv(brake_log_csv)
    change(table)
    path = tmp_path / "changed.csv"
    table.to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def brake_csv(tmp_path_factory):
    trace = tmp_path_factory.mktemp("bench") / "brake.csv"
    run(*BENCH, "--mode", "drive_brake", "--trace", trace)
    return trace


@pytest.mark.parametrize("keeps", [0.0, 0.75])  # of its last value: a filter of 15 ms
def test_a_current_sensors_offset_and_filter_are_told_apart(brake_csv, tmp_path, keeps):
    def changed(table):
        table["current_A"] = lfilter([1.0 - keeps], [1.0, -keeps], table["current_A"]) + 0.3

    log = changed_log(brake_csv, tmp_path, changed)
    e = json.loads(run("identify", "motor", log, "--json", "-").stdout)["estimates"]
    assert e["resistance_ohm"]["value"] == pytest.approx(RESISTANCE + SWITCHES, rel=0.02)
    assert e["torque_constant_N_m_A"]["value"] == pytest.approx(TORQUE_CONSTANT, rel=0.02)
    assert e["current_offset_A"]["value"] == pytest.approx(0.3, rel=0.05)
    if keeps:
        assert "coulomb_friction_N_m" not in e
    else:
        assert e["coulomb_friction_N_m"]["value"] == pytest.approx(0.004, rel=0.05)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("noisy", "filtered, late or noisy"),
        ("bent", "not linear"),
        ("supply", "the supply's current"),
        ("dead", "never changes"),
        ("wrong column", "not related"),
    ],
)
def test_a_current_that_is_not_the_motors_is_refused_with_the_reason(brake_csv, tmp_path, change, reason):
    def changed(table):
        i, u = table["current_A"].to_numpy(), table["u"].to_numpy()
        rng = np.random.default_rng(1)
        table["current_A"] = {
            "noisy": i + rng.normal(0.0, 0.3, len(i)),
            "bent": i * (1.0 - 0.5 * np.abs(i) / np.abs(i).max()),
            "supply": i * np.abs(u),
            "dead": 0.0 * i + 0.002,
            "wrong column": rng.normal(0.0, 1.0, len(i)),
        }[change]
        if change == "wrong column":
            table["angle_rad"] = rng.normal(0.0, 1.0, len(i)).cumsum()

    done = run("identify", "motor", changed_log(brake_csv, tmp_path, changed), status=2)
    assert reason in done.stderr and done.stderr.count("\n") == 1


def test_coasting_is_told_from_the_samples_alone(tmp_path):
    trace = tmp_path / "coast.csv"
    run(*BENCH, "--mode", "drive_coast", "--trace", trace)
    assert "the bridge coasts" in run("identify", "motor", trace, status=2).stderr


# R and k of the authors; None: refused. Of 26, the rest say why not.
REAL = {("current_sensor_30rs_60rs_3.txt", 1), ("current_sensor_30rs_60rs_3.txt", 2)}


@pytest.mark.parametrize("name", ["regbot_current_sensor", "regbot_motortest", "mini_segway_20d"])
def test_real_motors_are_as_published_or_refused(root, tmp_path, name):
    map_file = root / f"config/real/motors/{name}.toml"
    described = tomllib.loads(map_file.read_text())
    source = described["source"]
    folder = real_logs(root) / source["repository"].replace("/", "+")
    files = sorted(folder.glob(source["path"]))
    if not files:
        pytest.skip(f"no {source['path']}: docs/reality.md says where it is from")
    taken = set()
    for file in files:
        table = tmp_path / f"{file.name}.csv" if file.suffix == ".mat" else file
        if file.suffix == ".mat":
            matlab(file).to_csv(table, index=False)
        for motor in (1, 2):
            command = [
                binary(),
                "identify",
                "motor",
                table,
                "--map",
                map_file,
                "--motor",
                motor,
                "--json",
                "-",
            ]
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
            if done.returncode == 2:
                assert "R2" in done.stderr or "never changes" in done.stderr
                continue
            assert done.returncode == 0, done.stderr
            e = json.loads(done.stdout)["estimates"]
            for key, published in described["published"].items():
                assert e[key]["determined"]
                assert e[key]["value"] == pytest.approx(published, rel=0.1), (file.name, motor, key)
            taken.add((file.name, motor))
    assert taken == {each for each in REAL if each[0] in {f.name for f in files}}


def test_a_locked_step_gives_the_inductance(tmp_path):
    log = tmp_path / "step.lcm"
    run(*BENCH, "--mode", "drive_brake", "--locked-step", "--log", log)
    found = json.loads(run("identify", "motor", log, "--json", "-").stdout)["estimates"]
    assert found["inductance_H"]["value"] == pytest.approx(INDUCTANCE, rel=0.02)
    assert found["torque_constant_N_m_A"]["determined"] is False


def test_a_coasting_log_is_refused_with_the_reason(tmp_path):
    log = tmp_path / "coast.lcm"
    run(*BENCH, "--mode", "drive_coast", "--log", log)
    done = run("identify", "motor", log, status=2)
    assert done.stderr.count("\n") == 1
    assert f"{log}: the log was recorded in drive/coast mode" in done.stderr


def csv_of(path, rows, head="t_s,u,current_A,supply_V,angle_rad"):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_csv_logs_of_other_recorders_are_read(brake_log, tmp_path):
    trace = tmp_path / "trace.csv"
    run(*BENCH, "--mode", "drive_brake", "--trace", trace)
    from_csv = json.loads(run("identify", "motor", trace, "--json", "-").stdout)["estimates"]
    from_lcm = json.loads(run("identify", "motor", brake_log, "--json", "-").stdout)["estimates"]
    for name in ("resistance_ohm", "torque_constant_N_m_A"):
        assert from_csv[name]["value"] == pytest.approx(from_lcm[name]["value"], rel=1e-2)


@pytest.mark.parametrize(
    ("rows", "head", "message"),
    [
        ([(0.005 * i, 0, 0, 8, 0) for i in range(300)], None, "never driven"),
        ([(0.005 * i, 0.5, "nan", 8, i) for i in range(300)], None, "current_A is not measured"),
        ([(0.005 * i, 0.5, 0.1, 8, i) for i in range(20)], None, "record at least 200"),
        ([(0.0, 0.5, 0.1, 8, 0)] * 300, None, "time does not advance at sample 1"),
        ([(0.0, 0.5, "x", 8, 0)], None, '2: current_A: "x" is not a number'),
        ([(0.0, 0.5)], "t_s,u", "no column angle_rad"),
    ],
)
def test_unusable_logs_are_refused_in_one_line(tmp_path, rows, head, message):
    log = csv_of(tmp_path / "bad.csv", rows, head or "t_s,u,current_A,supply_V,angle_rad")
    done = run("identify", "motor", log, status=2)
    assert message in done.stderr
    assert str(log) in done.stderr
    assert done.stderr.count("\n") == 1


def test_no_log_and_a_wrong_one_are_usage_errors(tmp_path):
    assert "cannot be read" in run("identify", "motor", tmp_path / "none.lcm", status=2).stderr
    junk = tmp_path / "junk.lcm"
    junk.write_bytes(b"not a log" * 100)
    assert "not an LCM event log" in run("identify", "friction", junk, status=2).stderr
    run("identify", status=2)


def test_friction_comes_back_within_two_percent(tmp_path):
    log, fragment = tmp_path / "rig.lcm", tmp_path / "friction.toml"
    run("friction-rig", "--log", log, "--viscous-N-m-s", 0.003)
    done = run("identify", "friction", log, "--radius-ratio", 1.25, "--out", fragment, "--json", "-")
    found = json.loads(done.stdout)
    assert found["r_squared"] > 0.9
    for name, true in (
        ("coulomb_friction_N_m", 0.05265),
        ("viscous_friction_N_m_s", 0.003),
        ("flywheel_inertia_kg_m2", 1.5e-3),
    ):
        assert found["estimates"][name]["value"] == pytest.approx(true, rel=0.02)
        assert found["estimates"][name]["determined"]
    assert "[robot]\ncoulomb_friction_N_m = 0.05" in fragment.read_text()


@pytest.mark.parametrize("ratio", [None, 0.8])
def test_rig_and_identification_agree_without_a_word(tmp_path, ratio):
    log = tmp_path / "rig.lcm"
    run("friction-rig", "--log", log, *([] if ratio is None else ["--radius-ratio", ratio]))
    found = json.loads(run("identify", "friction", log, "--json", "-").stdout)["estimates"]
    assert found["viscous_friction_N_m_s"]["value"] == pytest.approx(0.001056, rel=0.05)


def test_a_log_that_does_not_say_the_ratio_asks_for_it(tmp_path):
    log = csv_of(tmp_path / "rig.csv", [(0.005 * i, 0.5, "nan", "nan", 0.01 * i) for i in range(400)])
    assert "--radius-ratio" in run("identify", "friction", log, status=2).stderr


def test_a_short_sweep_says_what_it_cannot_tell(tmp_path):
    log = tmp_path / "rig.lcm"
    run("friction-rig", "--log", log, "--amplitude-u", 0.25)
    assert "hardly moves" in run("identify", "friction", log, status=2).stderr
