"""What each word of the firmware means to whoever stands beside the robot, and what to do about it."""

from __future__ import annotations

from .. import names


def for_the_page() -> dict[str, list]:
    """Bit by bit: [word, sentence]."""

    def rows(table: tuple[names.Reason, ...]) -> list[list[str]]:
        return [[row.word, f"{row.text}: {row.remedy}"] for row in table]

    return {
        "arm_states": list(names.ARM_STATES),
        "reasons": rows(names.SAFETY_TABLE),
        "sensor_health": [[word, word] for word in names.SENSOR_HEALTH],
        "degraded": rows(names.DEGRADED_TABLE),
        "faults": list(names.FAULTS_TABLE),
    }
