"""equipoise config: show, diff and explain say what stands in the file and what reading it asks for."""

import json
import re
import subprocess
import tomllib

import pytest

ROBOTS = ["mbbr", "edumip"]


@pytest.fixture
def config(root):
    def run(*arguments, code=0):
        command = [root / "build/host/equipoise", "config", *arguments]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        return done

    return run


@pytest.mark.parametrize("robot", ROBOTS)
def test_show_is_the_file_with_its_edits(root, config, robot):
    shown = json.loads(config("show", "--config", f"config/{robot}.toml", "--json", "-").stdout)
    written = tomllib.loads((root / f"config/{robot}.toml").read_text(encoding="utf-8"))
    assert shown["robot.com_height_m"] == written["robot"]["com_height_m"]
    assert shown["robot.type"] == written["robot"]["type"]
    assert shown["calibration.R_BS"] == written["calibration"]["R_BS"]
    text = config("show", "--config", f"config/{robot}.toml", "--set", "friction.compensation=0.5").stdout
    assert tomllib.loads(text)["friction"]["compensation"] == 0.5


def test_every_key_of_the_file_is_known_to_show(root, config):
    """But the population's ranges, which are read when a robot is drawn."""
    shown = json.loads(config("show", "--config", "config/mbbr.toml", "--json", "-").stdout)

    def leaves(table, name=""):
        for key, value in table.items():
            if isinstance(value, dict):
                yield from leaves(value, f"{name}{key}.")
            elif isinstance(value, list) and all(isinstance(row, dict) for row in value):
                for i, row in enumerate(value):
                    yield from leaves(row, f"{name}{key}[{i}].")
            else:
                yield f"{name}{key}"

    written = tomllib.loads((root / "config/mbbr.toml").read_text(encoding="utf-8"))
    written.pop("population")
    written["world"]["built2025"].pop("population")
    assert sorted(leaves(written)) == sorted(shown)


def test_explain_names_unit_range_place_and_source(root, config):
    said = json.loads(
        config("explain", "robot.com_height_m", "--config", "config/mbbr.toml", "--json", "-").stdout
    )["keys"]
    lines = (root / "config/mbbr.toml").read_text(encoding="utf-8").splitlines()
    place = next(i for i, line in enumerate(lines, 1) if line.startswith("com_height_m"))
    assert said == [
        {
            "key": "robot.com_height_m",
            "value": 0.1,
            "unit": "m",
            "allowed": said[0]["allowed"],
            "where": f"config/mbbr.toml:{place}",
            "source": None,
        }
    ]
    low, high = map(float, said[0]["allowed"].split(" to "))
    for value in (low / 2, high * 2):  # the range is the one that is enforced
        refused = config(
            "show", "--config", "config/mbbr.toml", "--set", f"robot.com_height_m={value}", code=2
        )
        assert "out of range" in refused.stderr
    text = config("explain", "robot.body_mass_kg", "--config", "config/mbbr.toml").stdout
    assert re.search(r"source +\[T\] Table 5\.2", text)
    assert re.search(r"unit +kg$", text, re.MULTILINE)


def test_explain_says_where_an_override_came_from(config):
    text = config(
        "explain", "motor.bridge", "--config", "config/mbbr.toml", "--set", "motor.bridge=drive_brake"
    ).stdout
    assert 'motor.bridge = "drive_brake"' in text
    assert re.search(r"allowed +drive_brake, drive_coast", text)
    assert re.search(r"where +--set", text)


def test_explain_of_a_table_lists_its_keys_and_an_unknown_key_gets_a_hint(config):
    text = config("explain", "safety", "--config", "config/edumip.toml").stdout
    assert "safety.max_tilt_rad = " in text
    assert "robot." not in text
    refused = config("explain", "tilt_rad", "--config", "config/edumip.toml", code=2)
    assert "safety.max_tilt_rad" in refused.stderr


def test_diff_is_what_differs(root, config, tmp_path):
    text = config("diff", "config/mbbr.toml", "--set", "friction.compensation=0.5").stdout
    assert re.fullmatch(r"friction\.compensation: [0-9.]+ -> 0\.5\n", text)
    other = tmp_path / "other.toml"
    written = (root / "config/mbbr.toml").read_text(encoding="utf-8")
    other.write_text(written.replace("com_height_m = 0.100", "com_height_m = 0.125"), encoding="utf-8")
    rows = json.loads(config("diff", "config/mbbr.toml", other, "--json", "-").stdout)
    assert rows == {"robot.com_height_m": [0.1, 0.125]}
    assert config("diff", "config/mbbr.toml", "config/mbbr.toml").stdout == "no difference\n"
    assert "second file" in config("diff", "config/mbbr.toml", code=2).stderr
