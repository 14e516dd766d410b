"""What the JSON of each command holds: a key that goes is a change for whoever reads it."""

import json

import pytest
from driven import equipoise


def paths(value, at="") -> set[str]:
    """Keys with those above them; of a list, its first element's."""
    if isinstance(value, list):
        return paths(value[0], at) if value else set()
    if not isinstance(value, dict):
        return set()
    return {at + key for key in value}.union(*(paths(each, f"{at}{key}.") for key, each in value.items()))


@pytest.fixture(scope="module")
def places(root, tmp_path_factory):
    """What the table's commands name."""
    folder = tmp_path_factory.mktemp("keys")
    words = {name: str(folder / name.lower()) for name in ("LOG", "BENCH", "RIG", "OUT")}
    words |= {
        "MBBR": str(root / "config/mbbr.toml"),
        "MIP": str(root / "config/edumip.toml"),
        "BOARD": str(root / "config/boards/robotics_cape_mbbr.toml"),
    }
    assert equipoise(root, "friction-rig", "--log", words["RIG"]).returncode == 0
    return words


def test_are_those_of_the_table(root, places):
    """tests/data/json_keys.txt: a command, a colon, its keys; later ones read what earlier ones wrote."""
    for line in (root / "tests/data/json_keys.txt").read_text().splitlines():
        command, keys = line.split(": ")
        ended = equipoise(root, *(places.get(word, word) for word in command.split()), "--json", "-")
        assert ended.returncode == 0, (command, ended.stderr)
        assert paths(json.loads(ended.stdout)) == set(keys.split()), command
