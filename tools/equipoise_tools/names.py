"""Channels, and the words for what the firmware sends as numbers."""

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from equipoise_robot.channels import (
    COMMAND,
    FAULTS,
    HEALTH,
    MOTORS,
    REFERENCE,
    RUN,
    SENSORS,
    STATE,
    TIMING,
    TIMING_HISTOGRAM,
    TRUTH,
    VERDICT,
)

__all__ = [
    "COMMAND",
    "FAULTS",
    "HEALTH",
    "MOTORS",
    "REFERENCE",
    "RUN",
    "SENSORS",
    "STATE",
    "TIMING",
    "TIMING_HISTOGRAM",
    "TRUTH",
    "VERDICT",
]

ENDED = ("finished", "fell", "disarmed", "interrupted", "device")

ARM_STATES = ("disarmed", "armed", "fault")
# Bit by bit, enum rio_health.
SENSOR_HEALTH = (
    "imu clipped",
    "imu stuck",
    "imu late",
    "imu bus error",
    "dmp overflow",
    "dmp bad packet",
    "encoder error",
    "bridge fault",
    "battery error",
)
_ROOT = Path(__file__).resolve().parents[2]
_TABLE = _ROOT / "src" / "app" / "text" / "reasons.cpp"
_ROW = re.compile(
    r'\{\s*k\w+,\s*"(?P<name>\w+)",\s*(?P<text>(?:"[^"]*"\s*)+),\s*(?P<remedy>(?:"[^"]*"\s*)+)[,}]'
)
_LIMIT = re.compile(r'\{When::\w+, "(?P<what>[^"]*)", "[^"]*", \w+, &SafetyParams::(?P<key>\w+)')


@dataclass(frozen=True)
class Reason:
    """A row of the firmware's table: why the motors are off, or what the robot does without."""

    name: str
    text: str
    remedy: str
    limits: tuple[tuple[str, str], ...] = ()  # (value that is shown, key of its limit)

    @property
    def word(self) -> str:
        return self.name.replace("_", " ")


def rows_of(source: str, function: str) -> tuple[Reason, ...]:
    """Of the table that a function in reasons.cpp returns, bit by bit."""
    body = source.split(f"& {function}() {{", 1)[1].split("return rows;", 1)[0]
    found = list(_ROW.finditer(body))
    ends = [match.start() for match in found] + [len(body)]
    return tuple(
        Reason(
            match["name"],
            *("".join(re.findall(r'"([^"]*)"', match[part])) for part in ("text", "remedy")),
            tuple((limit["what"], f"safety.{limit['key']}") for limit in _LIMIT.finditer(body[begin:end])),
        )
        for match, (begin, end) in zip(found, pairwise(ends), strict=True)
    )


SAFETY_TABLE = rows_of(_TABLE.read_text(), "safety_reasons")
DEGRADED_TABLE = rows_of(_TABLE.read_text(), "degraded_modes")
SAFETY_REASONS = tuple(reason.word for reason in SAFETY_TABLE)
DEGRADED = tuple(mode.word for mode in DEGRADED_TABLE)
# What the fault detector weighs, by row and by bit.
_HYPOTHESES = (_ROOT / "include/equipoise/estimate/fault_hypotheses.hpp").read_text()
FAULTS_TABLE = tuple(re.findall(r'"(\w+)"', _HYPOTHESES.split("kFaultNames{", 1)[1].split("}", 1)[0]))


def bits(value: int, words: tuple[str, ...]) -> list[str]:
    """The words for the bits that are set; a bit without a word is named by its number."""
    return [words[i] if i < len(words) else f"bit {i}" for i in range(32) if value >> i & 1]


def fault(row: int) -> str:
    return FAULTS_TABLE[row] if 0 <= row < len(FAULTS_TABLE) else "no fault"


def arm_state(value: int) -> str:
    return ARM_STATES[value] if 0 <= value < len(ARM_STATES) else f"state {value}"


def estimator_of(channel: str) -> str | None:
    """EQUIPOISE_STATE_EKF13 -> "ekf13": the estimator that runs beside the controlling one."""
    return channel.removeprefix(STATE + "_").lower() if channel.startswith(STATE + "_") else None
