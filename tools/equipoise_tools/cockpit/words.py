"""What each word of the firmware means to whoever stands beside the robot, and what to do about it."""

from __future__ import annotations

from .. import names

REASONS = {
    "not requested": "nobody has asked for the motors",
    "tilt": "leans too far: hold it upright",
    "imu stale": "no fresh samples from the IMU: check its bus and its interrupt line",
    "encoder stale": "no fresh counts from the encoders",
    "not finite": "a number in the pipeline is not finite",
    "battery low": "battery too low: charge it",
    "attitude stale": "the attitude packets are too old",
    "gyro moving": "is moving: hold it still to arm",
    "not calibrated": "gyro or accelerometer not calibrated: equipoise calibrate",
    "encoder sign": "a wheel turns against its motor: wiring or sign of an encoder",
    "estimator unhealthy": "the estimator does not fit its sensors",
    "command stale": "no fresh command (matters only while arming)",
    "realtime missing": "no real-time scheduling: start it as the service does",
    "guard dead": "the guard process does not answer",
    "overrun": "a tick came too late",
    "picked up": "was picked up: put it down",
    "stall": "motors at full duty and nothing moves",
    "saturated": "motors at full duty for too long",
    "wheel slip": "a wheel slips on the ball",
    "encoder jump": "an encoder jumped",
    "bridge fault": "a motor bridge reports a fault: short circuit or heat",
    "write failed": "motor commands cannot be written",
    "log failed": "the log cannot be written: disk full?",
    "encoder stuck": "a motor turns and its encoder does not",
    "wheel one": "it is wheel 1",
    "wheel two": "it is wheel 2",
    "wheel three": "it is wheel 3",
    "wheel four": "it is wheel 4",
    "imu untrusted": "an axis of the IMU lies or stands still",
    "motor fault": "a motor does not do what it is told: dead, stuck, swapped or reversed",
}

DEGRADED = {
    "without imu": "IMU silent: the model bridges the gap",
    "without encoders": "encoders silent: the model bridges the gap",
    "estimator in doubt": "estimator in doubt: it stands",
    "without wheel one": "encoder of wheel 1 left out: slower",
    "without wheel two": "encoder of wheel 2 left out: slower",
    "without wheel three": "encoder of wheel 3 left out: slower",
    "without wheel four": "encoder of wheel 4 left out: slower",
    "without gyro axis": "a gyro axis left out: it stands",
    "gyro bias jumped": "the gyro's bias jumped and is taken off: slower",
}


def for_the_page() -> dict[str, list]:
    """Bit by bit: [word, sentence]."""
    return {
        "arm_states": list(names.ARM_STATES),
        "reasons": [[word, REASONS.get(word, word)] for word in names.SAFETY_REASONS],
        "sensor_health": [[word, word] for word in names.SENSOR_HEALTH],
        "degraded": [[word, DEGRADED.get(word, word)] for word in names.DEGRADED],
    }
