"""A log with known contents: what the report must find in it follows from the numbers here."""

import math
from pathlib import Path

import equipoise

import lcm

TICK_S = 0.005
RADIUS_M = 0.05
ATTITUDE_ERROR_RAD = 0.003  # constant, on both axes, of the controlling estimator
RATE_ERROR_RAD_S = 0.4
OTHER_FACTOR = 5.0  # the estimator beside it is this much worse
POSITION_ERROR_M = 0.02
YAW_HZ = 0.5
DRIVE_M_S = 0.2
DRIVE_FROM_S, DRIVE_TO_S = 6.0, 9.0


def _state(tick: int, theta_x: float, theta_y: float, rate_error: float = 0.0, shift_m: float = 0.0):
    t = tick * TICK_S
    state = equipoise.state_t()
    state.tick = tick
    state.utime = round(t * 1e6)
    yaw = 2 * math.pi * YAW_HZ * t
    state.theta_rad = [theta_x, theta_y, math.remainder(yaw, 2 * math.pi)]
    state.omega_B_rad_s = [0.0, 0.0, 2 * math.pi * YAW_HZ]
    state.phi_dot_rad_s = [1.0 + rate_error, -2.0 + rate_error]
    driven_s = min(max(t - DRIVE_FROM_S, 0.0), DRIVE_TO_S - DRIVE_FROM_S)
    state.position_W_m = [DRIVE_M_S * driven_s + shift_m, 0.0]
    return state


def _run(robot: str):
    run = equipoise.run_t()
    run.robot = robot
    run.estimator, run.controller, run.fidelity = "ekf", "scheduled", "nominal"
    run.seed, run.rolling_radius_m = 7, RADIUS_M
    run.version, run.config_sha256 = "0.0.0", "ab" * 32
    return run


def write_log(
    path: Path,
    duration_s: float = 10.0,
    robot: str = "mbbr",
    fall_at_s: float = math.inf,
    disarmed_at_s: float = math.inf,  # upright, for a stale IMU
    faulty: tuple[float, float] | None = None,  # the second encoder, from, to; None: nothing is weighed
) -> Path:
    log = lcm.EventLog(str(path), "w", overwrite=True)
    run = _run(robot)
    log.write_event(0, "EQUIPOISE_RUN", run.encode())
    two_axes = 1.0 if robot == "mbbr" else 0.0
    for tick in range(round(duration_s / TICK_S)):
        t = tick * TICK_S
        utime = round(t * 1e6)
        x = 0.02 * math.sin(2 * t) if t < fall_at_s else 1.2
        y = 0.02 * math.cos(2 * t) * two_axes

        command = equipoise.command_t()
        command.utime, command.tick, command.arm = utime, tick, True
        command.yaw_rate_rad_s = 2 * math.pi * YAW_HZ
        command.velocity_W_m_s = [DRIVE_M_S if DRIVE_FROM_S <= t <= DRIVE_TO_S else 0.0, 0.0]
        motors = equipoise.motors_t()
        motors.utime, motors.tick, motors.enable = utime, tick, True
        motors.motors = 3 if robot == "mbbr" else 2
        motors.duty = [0.5 * math.sin(3 * t), -0.75 if tick == 100 else 0.1, 0.2 * two_axes, 0.0]
        motors.saturated = tick % 4 == 0
        health = equipoise.health_t()
        health.utime, health.tick, health.battery_V = utime, tick, 8.0 - 0.01 * t
        health.arm_state = 1 if 0.5 <= t < fall_at_s else (0 if t < 0.5 else 2)
        health.reasons = {1: 0, 0: 1, 2: 2}[health.arm_state]
        if t >= disarmed_at_s:
            health.arm_state, health.reasons = 2, 4
        timing = equipoise.timing_t()
        timing.utime, timing.tick, timing.compute_ns = utime, tick, 9000 if tick == 10 else 2000
        timing.overruns, timing.dropped_records = 3, 4
        messages = {
            "EQUIPOISE_COMMAND": command,
            "EQUIPOISE_TRUTH": _state(tick, x, y),
            "EQUIPOISE_STATE": _state(tick, x + ATTITUDE_ERROR_RAD, y - ATTITUDE_ERROR_RAD, RATE_ERROR_RAD_S),
            "EQUIPOISE_STATE_EKF13": _state(
                tick, x - OTHER_FACTOR * ATTITUDE_ERROR_RAD, y + OTHER_FACTOR * ATTITUDE_ERROR_RAD, -2.0
            ),
            "EQUIPOISE_REFERENCE": _state(tick, 0.0, 0.0, shift_m=-POSITION_ERROR_M),
            "EQUIPOISE_MOTORS": motors,
            "EQUIPOISE_HEALTH": health,
            "EQUIPOISE_TIMING": timing,
        }
        if faulty:
            faults = messages["EQUIPOISE_FAULTS"] = equipoise.faults_t()
            faults.utime, faults.tick = utime, tick
            faults.leading, faults.ratio, faults.bound = 1, 2.0, 18.6
            faults.runner_up, faults.runner_up_ratio = -1, 0.0
            faults.decided = tick in (round(at_s / TICK_S) for at_s in faulty)
            faults.verdicts = 2 if faulty[0] <= t < faulty[1] else 0
            if faults.decided:
                faults.ratio, faults.runner_up, faults.runner_up_ratio = 21.44, 22, 3.0
        for channel, message in messages.items():
            log.write_event(utime, channel, message.encode())
    log.close()
    return path
