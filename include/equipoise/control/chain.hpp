// Delays between the motion and the maths, and between the maths and the torque, as the design takes them.
// Values: the configuration's [chain]. Plain data.
#pragma once

namespace equipoise {

struct Chain {
  double gyro_delay_s = 0.0;  // of the IMU's low-pass filter
  double accel_delay_s = 0.0;
  double attitude_delay_s = 0.0;   // of the attitude source
  double actuation_delay_s = 0.0;  // tick to new duty: sampling, computing, the PWM's update; below a tick
};

}  // namespace equipoise
