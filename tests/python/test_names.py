"""The words for the firmware's numbers follow the C++ and C headers, where these exist."""

import re
from dataclasses import replace

import pytest
from equipoise_tools import names


def enumerators(text: str, enum: str) -> list[tuple[str, int]]:
    """(words, value) of the enum's members; a bit counts by its position."""
    body = re.search(rf"enum (?:class )?{enum}\b[^{{]*\{{(.*?)\}}", text, re.S)[1]
    members = re.findall(r"\b(?:k|RIO_)(\w+)\s*=\s*(?:1u\s*<<\s*)?(\d+)", body)
    spaced = [(re.sub(r"(?<=[a-z])(?=[A-Z])|_", " ", name).lower(), int(value)) for name, value in members]
    return sorted(spaced, key=lambda member: member[1])


@pytest.mark.parametrize(
    ("header", "enum", "words"),
    [
        ("include/equipoise/actuate/safety.hpp", "ArmState", names.ARM_STATES),
        ("include/equipoise/sample.h", "rio_health", names.SENSOR_HEALTH),
    ],
)
def test_words_follow_the_headers(root, header, enum, words):
    assert enumerators((root / header).read_text(), enum) == [(word, i) for i, word in enumerate(words)]


@pytest.mark.parametrize(
    ("header", "enum", "table"),
    [
        ("include/equipoise/actuate/safety_reasons.hpp", "SafetyReason", names.SAFETY_TABLE),
        ("include/equipoise/actuate/degraded.hpp", "DegradedBit", names.DEGRADED_TABLE),
    ],
)
def test_the_table_of_reasons_has_a_row_with_a_remedy_for_each_bit(root, header, enum, table):
    members = enumerators((root / header).read_text(), enum)
    spelled = dict(
        zip(("wheel 1", "wheel 2", "wheel 3", "wheel 4"), ("one", "two", "three", "four"), strict=True)
    )
    for wheel, number in spelled.items():
        table = [replace(row, name=row.word.replace(wheel, f"wheel {number}")) for row in table]
    assert members == [(row.word, i) for i, row in enumerate(table)]
    assert all(len(row.text) > 8 and len(row.remedy) > 8 for row in table)


def test_hypotheses_follow_the_header():
    assert names.FAULTS_TABLE[:2] == ("encoder_1", "encoder_2")
    assert names.FAULTS_TABLE[-2:] == ("event", "gyro_drift")
    assert len(set(names.FAULTS_TABLE)) == 4 + 4 + 6 + 3 + 3 + 9  # for four wheels
    assert names.fault(20) == "gyro_bias" and names.fault(-1) == names.fault(99) == "no fault"


def test_bits_without_a_word_are_named_by_number():
    assert names.bits(0b101, ("a", "b")) == ["a", "bit 2"]
    assert names.arm_state(9) == "state 9"
    assert names.estimator_of("EQUIPOISE_STATE_EKF13_PUBLISHED") == "ekf13_published"
    assert names.estimator_of("EQUIPOISE_STATE") is None
