"""`convert --to lerobot`: compared with the log, and read by LeRobot's own loader where it is installed."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
parquet = pytest.importorskip("pyarrow.parquet")
import pandas  # noqa: E402
from driven import equipoise  # noqa: E402
from equipoise_robot import channels as ch  # noqa: E402
from equipoise_robot import lerobot  # noqa: E402
from equipoise_robot.errors import UserError  # noqa: E402
from equipoise_robot.log import Log  # noqa: E402

# LeRobot brings torch: too much for tools/requirements-optional.txt. A Python that has it may be named.
LEROBOT_PYTHON = os.environ.get("EQUIPOISE_LEROBOT_PYTHON", sys.executable)
LOAD = """
import json, sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("equipoise/run", root=sys.argv[1], delta_timestamps={"action": [-0.005, 0.0]})
frames = [data[i] for i in (0, 1, len(data) - 1)]
said = {key: [frame[key].tolist() for frame in frames] for key in data.features}
said |= {"task": frames[0]["task"], "padded": [f["action_is_pad"].tolist() for f in frames]}
said |= {"count": [len(data), data.num_episodes, data.fps]}
said |= {"means": data.meta.stats["action"]["mean"].tolist()}
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def folder(root, log):
    converted = equipoise(root, "convert", log, "--to", "lerobot")
    assert converted.returncode == 0, converted.stderr
    assert "episodes 1" in converted.stdout
    return log.with_suffix(".lerobot")


def frames_of(folder):
    """As LeRobot finds them: by the template in info.json, by the features named there."""
    info = json.loads((folder / "meta/info.json").read_text())
    table = parquet.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(table.column_names) == set(info["features"])
    frames = {name: np.stack(table[name].to_numpy(zero_copy_only=False)) for name in table.column_names}
    for name, feature in info["features"].items():
        assert (
            list(frames[name].shape[1:] or [1]) == feature["shape"] and frames[name].dtype == feature["dtype"]
        )
        assert feature["names"] is None or len(feature["names"]) == feature["shape"][0]
    return info, frames


def armed(read):
    ran = (read[ch.HEALTH]["arm_state"] == 1) & (read[ch.MOTORS]["enable"] != 0)
    return np.flatnonzero(ran)


def test_frames_are_the_logs_ticks_with_running_motors(log, robot, folder):
    read = Log(log)
    info, frames = frames_of(folder)
    rows = armed(read)
    assert 500 < len(rows) < len(read[ch.SENSORS])  # it is held first
    assert info["total_frames"] == len(frames["index"]) == len(rows) and info["fps"] == 200
    motors = {"mbbr": 3, "mip": 2}[robot]
    assert frames["action"] == pytest.approx(read[ch.MOTORS]["duty"][rows, :motors], abs=1e-6)
    assert np.abs(frames["action"]).max() > 0.01
    z = read.sensors()[rows]
    expected = {"gyro_B_rad_s": z["gyro_B_rad_s"], "accel_B_m_s2": z["accel_B_m_s2"]}
    expected |= {"wheel_angle_rad": z["wheel_angle_rad"], "battery_V": z["battery_V"][:, None]}
    assert frames["observation.sensors"] == pytest.approx(
        np.hstack(list(expected.values())), rel=1e-6, abs=1e-6
    )
    names = info["features"]["observation.sensors"]["names"]
    assert [names.index(f"{key}.{'x' if key[0] != 'w' else 0}") for key in list(expected)[:3]] == [0, 3, 6]
    for channel, key in ((ch.STATE, "observation.state"), (ch.REFERENCE, "observation.reference")):
        names = info["features"][key]["names"]
        for field, column in (("theta_rad", 0), ("omega_B_rad_s", 1), ("phi_dot_rad_s", 1)):
            found = frames[key][:, names.index(f"{field}.{'xyz'[column]}")]
            assert found == pytest.approx(read[channel][field][rows, column], rel=1e-6, abs=1e-6)
    command = read[ch.COMMAND][rows]
    names = info["features"]["observation.command"]["names"]
    assert frames["observation.command"][:, names.index("yaw_rate_rad_s")] == pytest.approx(
        command["yaw_rate_rad_s"], rel=1e-6
    )


def test_metadata_says_what_is_there(folder):
    info, frames = frames_of(folder)
    episodes = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    count = len(frames["index"])
    (episode,) = episodes
    assert (episode["episode_index"], episode["length"]) == (0, count)
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (0, count)
    tasks = pandas.read_parquet(folder / "meta/tasks.parquet")
    assert episode["tasks"] == [tasks.iloc[0].name] and tasks["task_index"].tolist() == [0]
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert set(stats) == set(info["features"])
    for key, values in frames.items():
        assert np.ravel(stats[key]["mean"]) == pytest.approx(values.mean(axis=0, dtype=float), abs=1e-5)
        assert stats[key]["count"] == [count]
        assert episode[f"stats/{key}/max"] == stats[key]["max"]
    assert frames["timestamp"] == pytest.approx(np.arange(count) / 200, abs=1e-4)


def test_a_gap_ends_an_episode_and_logs_make_one_dataset(log, tmp_path):
    whole = Log(log)
    rows = armed(whole)
    cut = int(whole[ch.SENSORS]["tick"][rows[0]]) + 300
    gap = Log.of(
        {name: r[r["tick"] != cut] if "tick" in (r.dtype.names or ()) else r for name, r in whole.items()}
    )
    out = tmp_path / "both"
    assert lerobot.write([whole, gap], out) == {"episodes": 3, "frames": 2 * len(rows) - 1}
    _, frames = frames_of(out)
    lengths = np.bincount(frames["episode_index"])
    assert lengths.tolist() == [len(rows), 300, len(rows) - 301]
    assert frames["index"].tolist() == list(range(2 * len(rows) - 1))
    assert frames["frame_index"][len(rows) : len(rows) + 301].tolist() == [*range(300), 0]
    whole_action, rest = np.split(frames["action"], [len(rows)])
    assert np.array_equal(rest, np.delete(whole_action, 300, axis=0))


def test_what_holds_no_episode_or_is_there_already_is_refused(root, log, folder, tmp_path):
    again = equipoise(root, "convert", log, "--to", "lerobot")
    assert again.returncode == 2 and f"{folder}: exists; choose another --out" in again.stderr
    whole = Log(log)
    held = Log.of(dict(whole))
    health = np.array(whole[ch.HEALTH])
    health["arm_state"] = 0
    held[ch.HEALTH] = health
    with pytest.raises(UserError, match="its motors never ran"):
        lerobot.write(held, tmp_path / "held")
    del held[ch.REFERENCE]
    with pytest.raises(UserError, match="has no EQUIPOISE_REFERENCE"):
        lerobot.write(held, tmp_path / "held")
    assert not (tmp_path / "held").exists()


def test_lerobots_own_loader_reads_it(folder):
    probe = subprocess.run(
        [LEROBOT_PYTHON, "-c", "import lerobot.datasets.lerobot_dataset"], capture_output=True, check=False
    )
    if probe.returncode:
        pytest.skip("needs lerobot 0.4; EQUIPOISE_LEROBOT_PYTHON names a Python that has it")
    offline = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(folder.parent / "hub")}
    loaded = subprocess.run(
        [LEROBOT_PYTHON, "-c", LOAD, folder], capture_output=True, text=True, check=False, env=offline
    )
    assert loaded.returncode == 0, loaded.stderr
    said = json.loads(loaded.stdout)
    info, frames = frames_of(folder)
    count = len(frames["index"])
    assert said["count"] == [count, 1, 200] and said["task"] == "balance and follow the command"
    for key in set(info["features"]) - {"action"}:
        assert said[key] == [pytest.approx(frames[key][i]) for i in (0, 1, count - 1)]
    assert said["padded"] == [[True, False], [False, False], [False, False]]
    assert said["action"][1] == [pytest.approx(row) for row in frames["action"][:2]]
    assert said["means"] == pytest.approx(frames["action"].mean(axis=0), abs=1e-6)
