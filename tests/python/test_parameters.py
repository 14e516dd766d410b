"""Every configuration key has a meaning and a source; the reference shows what the firmware takes."""

import pytest
from equipoise_tools import parameters


@pytest.fixture(scope="module")
def facts(root):
    return {name: parameters.keys_of(name) for name in parameters.CONFIGURATIONS}


@pytest.mark.parametrize("name", parameters.CONFIGURATIONS)
def test_every_key_has_a_meaning_and_a_source(facts, name):
    assert parameters.missing(facts[name], parameters.meanings()) == []


def test_a_key_without_a_source_is_found(facts):
    told = dict(parameters.meanings())
    del told["robot.com_height_m"]
    told["safety.max_tilt_rad"] = ("a meaning", "")
    assert parameters.missing(facts["mbbr"], told) == ["robot.com_height_m", "safety.max_tilt_rad"]


def test_no_key_is_explained_that_does_not_exist(facts):
    """But pushes, an empty list, and what only a world of tests has."""
    assert sorted(set(parameters.meanings()) - set().union(*facts.values())) == ["world.*.pushes"]


def test_the_reference_is_that_of_the_firmware(facts, root):
    page = parameters.page({robot: facts[robot] for robot in parameters.ROBOTS}, parameters.meanings())
    assert (root / "docs/parameters.md").read_text(
        encoding="utf-8"
    ) == page, "run build/venv/bin/python -m equipoise_tools.parameters"


def test_the_range_is_the_one_that_is_enforced(facts, root):
    assert facts["mbbr"]["robot.com_height_m"]["allowed"] == "0.005 to 2"
    assert "| `com_height_m` |" in (root / "docs/parameters.md").read_text(encoding="utf-8")
