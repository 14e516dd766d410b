"""The reference of reasons is that of the firmware's table and configurations."""

import re

import pytest
from equipoise_tools import parameters, reasons


@pytest.fixture(scope="module")
def facts(root):
    return {robot: parameters.keys_of(robot) for robot in parameters.ROBOTS}


@pytest.fixture(scope="module")
def table(root):
    return (root / reasons.TABLE).read_text(encoding="utf-8")


def test_the_reference_is_that_of_the_firmware(facts, root, table):
    committed = (root / "docs/reasons.md").read_text(encoding="utf-8")
    page = reasons.page(table, facts)
    assert committed == page, "run build/venv/bin/python -m equipoise_tools.reasons"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("hold it upright before arming", "hold it by hand"),
        ("a duty could not be written", "a write failed"),
        ("&SafetyParams::max_fall_rad", "&SafetyParams::max_tilt_rad"),
        ("no IMU sample: the model bridges the gap", "no IMU sample"),
        ('"guard_dead"', '"guard_gone"'),
    ],
)
def test_a_changed_reason_makes_the_page_stale(facts, table, before, after):
    assert table.count(before) == 1
    assert reasons.page(table.replace(before, after), facts) != reasons.page(table, facts)


def test_so_does_a_changed_limit(facts, table):
    key = "safety.max_tilt_rad"
    other = {robot: {**found, key: {**found[key], "value": 0.123}} for robot, found in facts.items()}
    assert "tilt: `safety.max_tilt_rad` 0.123 rad" in reasons.page(table, other)


def test_every_key_that_a_reason_names_exists(facts, table):
    named = set(re.findall(r"\bsafety\.\w+", table)) | {
        f"safety.{key}" for key in re.findall(r"SafetyParams::(\w+)\b(?!;)", table)
    }
    assert len(named) > 15
    assert sorted(named - set(facts["mbbr"])) == []
