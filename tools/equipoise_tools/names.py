"""Channels, and the words for what the firmware sends as numbers (a test holds them to the C++ headers)."""

from equipoise_robot.channels import (
    COMMAND,
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
# Bit by bit, enum SafetyReason.
SAFETY_REASONS = (
    "not requested",
    "tilt",
    "imu stale",
    "encoder stale",
    "not finite",
    "battery low",
    "attitude stale",
    "gyro moving",
    "not calibrated",
    "encoder sign",
    "estimator unhealthy",
    "command stale",
    "realtime missing",
    "guard dead",
    "overrun",
    "picked up",
    "stall",
    "saturated",
    "wheel slip",
    "encoder jump",
    "bridge fault",
    "write failed",
    "log failed",
    "encoder stuck",
    "wheel one",
    "wheel two",
    "wheel three",
    "wheel four",
    "imu untrusted",
    "motor fault",
)
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
# Bit by bit, enum DegradedBit.
DEGRADED = (
    "without imu",
    "without encoders",
    "estimator in doubt",
    "without wheel one",
    "without wheel two",
    "without wheel three",
    "without wheel four",
    "without gyro axis",
    "gyro bias jumped",
)


def bits(value: int, words: tuple[str, ...]) -> list[str]:
    """The words for the bits that are set; a bit without a word is named by its number."""
    return [words[i] if i < len(words) else f"bit {i}" for i in range(32) if value >> i & 1]


def arm_state(value: int) -> str:
    return ARM_STATES[value] if 0 <= value < len(ARM_STATES) else f"state {value}"


def estimator_of(channel: str) -> str | None:
    """EQUIPOISE_STATE_EKF13 -> "ekf13": the estimator that runs beside the controlling one."""
    return channel.removeprefix(STATE + "_").lower() if channel.startswith(STATE + "_") else None
