"""calibrate and bringup from the command line, on the practice robot (--backend stand)."""

import json
import re
import resource
import subprocess
from pathlib import Path

import pytest

BOARDS = {"mbbr": "robotics_cape_mbbr", "edumip": "robotics_cape_edumip"}


MBBR = Path(__file__).resolve().parents[2] / "config/mbbr.toml"


def equipoise(root, *arguments, **popen):
    command = [root / "build/host/equipoise", *arguments]
    return subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, **popen
    )


def on_stand(root, command, *arguments, robot="mbbr"):
    board = root / f"config/boards/{BOARDS[robot]}.toml"
    bench = ["--board", board, "--backend", "stand"]
    if "--config" not in arguments:
        bench += ["--config", root / f"config/{robot}.toml"]
    return equipoise(root, *command.split(), *bench, "--json", "-", *arguments)


def values(path: Path, key: str) -> list[float]:
    return json.loads(re.search(rf"^{key} = (\[.*\])$", path.read_text(), re.M)[1])


@pytest.mark.parametrize("robot", BOARDS)
def test_every_calibration_adds_its_part_to_one_file(root, tmp_path, robot):
    out = tmp_path / "calibration.toml"
    for what in ("gyro", "accel", "mount", "motors", "encoders"):
        ended = on_stand(root, f"calibrate {what}", "--out", out, robot=robot)
        assert ended.returncode == 0, ended.stderr
        assert json.loads(ended.stdout)["what"] == what
    assert re.findall(r"^\[(\w+)\]$", out.read_text(), re.M) == [
        *("gyro", "accel", "mount", "motors", "encoders")
    ]
    # The practice chip's axes read 1 % long, 1.5 % short and 2 % long.
    assert values(out, "scale") == pytest.approx([1 / 1.01, 1 / 0.985, 1 / 1.02], abs=0.005)


def test_motion_is_refused_with_its_size_and_nothing_is_written(root, tmp_path):
    out = tmp_path / "calibration.toml"
    ended = on_stand(root, "calibrate gyro", "--out", out, "--practice-fault", "moving")
    assert ended.returncode == 1
    assert re.search(r"30\.\d deg/s at rest is no bias", ended.stderr) and ended.stderr.count("\n") == 1
    assert not out.exists()


def test_a_calibration_through_a_link_renews_the_file_and_no_other(root, tmp_path):
    out, link, other = (tmp_path / n for n in ("calibration.toml", "link.toml", "calibration.toml.partial"))
    link.symlink_to(out)
    other.write_text("mine")
    for _ in range(2):
        assert on_stand(root, "calibrate gyro", "--out", link if out.exists() else out).returncode == 0
    assert link.is_symlink() and other.read_text() == "mine"
    assert sorted(tmp_path.iterdir()) == [out, other, link]


def test_a_full_disk_leaves_the_calibration_as_it_was(root, tmp_path):
    out = tmp_path / "calibration.toml"
    assert on_stand(root, "calibrate gyro", "--out", out).returncode == 0
    before = out.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        ended = on_stand(root, "calibrate gyro", "--out", out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert ended.returncode == 2 and "calibration.toml: cannot be written" in ended.stderr
    assert list(tmp_path.iterdir()) == [out] and out.read_bytes() == before


def test_a_poor_fit_of_the_accelerometer_is_not_kept(root, tmp_path):
    """Beyond 15 mg, hardware.md says, nothing is written: what was measured before stays."""
    out = tmp_path / "calibration.toml"
    assert on_stand(root, "calibrate accel", "--out", out).returncode == 0
    good = out.read_bytes()
    table = re.search(r"^\[world\.nominal\]$.*?^accel_sigma_m_s2 = (\S+)$", MBBR.read_text(), re.M | re.S)
    shaken = tmp_path / "shaken.toml"  # a noise of 4 m/s2: means of 200 samples are off by 30 mg
    shaken.write_text(MBBR.read_text()[: table.start(1)] + "4.0" + MBBR.read_text()[table.end(1) :])
    ended = on_stand(root, "calibrate accel", "--config", shaken, "--seed", "2", "--out", out)
    assert ended.returncode == 1 and f"not written to {out}" in ended.stderr
    result = json.loads(ended.stdout)
    assert result["check_error_mg"] > 15.0 and "the fit is poor" in result["complaint"]
    assert out.read_bytes() == good


def test_a_wiring_fault_fails_the_calibration_and_names_the_cure(root, tmp_path):
    ended = on_stand(
        root, "calibrate motors", "--out", tmp_path / "c.toml", "--practice-fault", "motor-2-reversed"
    )
    assert ended.returncode == 1
    assert json.loads(ended.stdout)["complaint"].startswith("motor 2 turns backwards")
    assert "equipoise bringup" in ended.stderr


def test_bringup_writes_a_board_file_that_fits_and_run_reads_its_calibration(root, tmp_path):
    board = tmp_path / "robot.toml"
    faults = ["--practice-fault", "motors-1-3-swapped", "encoder-2-reversed"]
    ended = on_stand(root, "bringup", "--out", board, *faults)
    assert ended.returncode == 0, ended.stderr
    assert "motor 1 turns wheel 3" in json.loads(ended.stdout)["corrected"]
    said = ended.stderr
    for text in ("2 of 4", "3 of 4", "motor 2: moves at 16 % torque, encoder 2 counts down", "4 of 4: again"):
        assert text in said
    assert said.count("  motor 3: ") == 2 and f"written to {board}" in said
    calibration = tmp_path / "robot-calibration.toml"
    assert f"--board {board} --out {calibration} --backend stand" in said
    assert values(calibration, "bias_rad_s")
    # Whoever reads the board file reads the calibration beside it, strictly.
    ended = equipoise(root, "doctor", "--board", board, "--root", tmp_path)  # no robot here
    assert ended.returncode == 0 and "without an error" in ended.stdout
    calibration.write_text(calibration.read_text().replace("version = 1", "version = 9"))
    ended = equipoise(root, "doctor", "--board", board)
    assert ended.returncode == 2 and "robot-calibration.toml" in ended.stderr and "version" in ended.stderr
    # Nothing is overwritten unasked.
    ended = on_stand(root, "bringup", "--out", board)
    assert ended.returncode == 2 and "--force" in ended.stderr


def test_a_dead_motor_stops_bringup_without_a_board_file(root, tmp_path):
    ended = on_stand(root, "bringup", "--out", tmp_path / "b.toml", "--practice-fault", "motor-3-dead")
    assert ended.returncode == 1 and "motor 3: no encoder moves" in ended.stderr
    assert not list(tmp_path.iterdir())


def test_without_a_board_the_real_robot_is_refused_clearly(root, tmp_path):
    bench = ["--config", root / "config/mbbr.toml", "--board", root / "config/boards/robotics_cape_mbbr.toml"]
    ended = equipoise(root, "calibrate", "gyro", *bench, "--out", tmp_path / "c.toml")
    assert ended.returncode == 1 and "equipoise doctor" in ended.stderr and ended.stderr.count("\n") == 1
    ended = equipoise(root, "bringup", *bench, "--out", tmp_path / "b.toml")
    assert ended.returncode == 1 and "doctor: board: " in ended.stderr


@pytest.mark.parametrize(
    "arguments, named",
    [
        (["calibrate", "magnet"], "magnet"),
        (["calibrate", "gyro", "--practice-fault", "gremlin"], "gremlin"),
        (["calibrate", "gyro", "--config", "config/edumip.toml"], "board.robot"),
    ],
)
def test_bad_usage_is_one_clear_error(root, tmp_path, arguments, named):
    bench = ["--board", "config/boards/robotics_cape_mbbr.toml", "--backend", "stand"]
    if "--config" not in arguments:
        bench += ["--config", "config/mbbr.toml"]
    ended = equipoise(root, *arguments, *bench, "--out", tmp_path / "c.toml", cwd=root)
    assert ended.returncode == 2 and named in ended.stderr
    assert not (tmp_path / "c.toml").exists()
