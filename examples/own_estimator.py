"""The eduMIP on an estimator of one's own: a complementary filter of its tilt.

python examples/own_estimator.py
"""

import equipoise_robot as eq
import numpy as np


class ComplementaryFilter:
    """Tilt from the gyro in the short run and from gravity in the long run; the rest from the robot's own
    filter."""

    def __init__(self, time_constant_s: float = 1.0, tick_s: float = 0.005) -> None:
        self.share = tick_s / (time_constant_s + tick_s)
        self.tick_s = tick_s
        self.tilt_rad: float | None = None

    def __call__(self, tick: eq.EstimatorTick) -> eq.State:
        _, y, z = tick.accel_B_m_s2  # body axes x left, y back, z up; at rest (0, 0, -9.8)
        by_gravity = np.arctan2(-y, -z)
        if self.tilt_rad is None or tick.held:
            self.tilt_rad = by_gravity
        by_gyro = self.tilt_rad + tick.gyro_B_rad_s[0] * self.tick_s
        self.tilt_rad = by_gyro + self.share * (by_gravity - by_gyro)
        state = tick.own
        state.theta_rad[0] = self.tilt_rad
        return state


if __name__ == "__main__":
    for estimator in ("complementary", "ekf", ComplementaryFilter()):
        run = eq.run("mip", estimator=estimator, drive_mps=0.2, duration_s=20.0)
        print(f"{run.estimator:20} {run.ended}, tilt error {1e3 * run.attitude_rmse_rad:.1f} mrad RMS")
