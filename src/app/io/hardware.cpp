#include "app/io/hardware.hpp"

namespace equipoise::app {

RawSample from_rio(const rio_sensors_t& s) noexcept {
  RawSample raw;
  raw.t_ns = s.t_ns;
  for (std::size_t i = 0; i < 3; ++i) {
    raw.gyro_counts[i] = s.gyro_counts[i];
    raw.accel_counts[i] = s.accel_counts[i];
  }
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    raw.encoder_counts[i] = s.encoder_counts[i];
    raw.attitude_wxyz[i] = s.attitude_wxyz[i];
  }
  raw.battery_counts = s.battery_counts;
  raw.imu_ok = (s.valid & RIO_IMU) != 0;
  raw.encoders_ok = (s.valid & RIO_ENCODERS) != 0;
  raw.battery_ok = (s.valid & RIO_BATTERY) != 0;
  raw.attitude_ok = (s.valid & RIO_ATTITUDE) != 0;
  raw.health = s.health;
  return raw;
}

rio_sensors_t to_rio(const RawSample& raw) noexcept {
  rio_sensors_t s{};
  s.t_ns = raw.t_ns;
  for (std::size_t i = 0; i < 3; ++i) {
    s.gyro_counts[i] = raw.gyro_counts[i];
    s.accel_counts[i] = raw.accel_counts[i];
  }
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    s.encoder_counts[i] = raw.encoder_counts[i];
    s.attitude_wxyz[i] = raw.attitude_wxyz[i];
  }
  s.battery_counts = raw.battery_counts;
  s.valid = (raw.imu_ok ? static_cast<unsigned>(RIO_IMU) : 0U) |
            (raw.encoders_ok ? static_cast<unsigned>(RIO_ENCODERS) : 0U) |
            (raw.battery_ok ? static_cast<unsigned>(RIO_BATTERY) : 0U) |
            (raw.attitude_ok ? static_cast<unsigned>(RIO_ATTITUDE) : 0U);
  s.health = raw.health;
  return s;
}

rio_motors_t to_rio(const MotorCommand& command) noexcept {
  rio_motors_t motors{};
  for (std::size_t i = 0; i < kMaxMotors; ++i) motors.duty[i] = command.duty[i];
  motors.enable = command.enable;
  return motors;
}

MotorCommand from_rio(const rio_motors_t& motors) noexcept {
  MotorCommand command;
  for (std::size_t i = 0; i < kMaxMotors; ++i) command.duty[i] = motors.duty[i];
  command.enable = motors.enable;
  return command;
}

}  // namespace equipoise::app
