#include "app/commission/manual_drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "app/board/self_test.hpp"
#include "app/cli/interrupt.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {

RawSample ManualDrive::next() {
  for (int missed = 0;; ++missed) {
    if (interrupted.load(std::memory_order_relaxed)) throw JobError("interrupted; motors are off");
    std::int64_t now_ns = 0;
    const int status = hardware_.wait_tick(&now_ns);
    if (status != 0) throw JobError(std::string("no tick: ") + std::strerror(-status) + "; motors are off");
    beat();
    const RawSample raw = hardware_.read();
    if (imu_ok(raw) && encoders_ok(raw)) {
      temperature_degC_ = raw.imu_temperature_degC;
      return raw;
    }
    if (missed < kMayMiss) continue;
    const std::string what = imu_ok(raw) ? "an encoder cannot be read" : "the IMU delivers no valid sample";
    throw JobError(what + " (equipoise doctor finds the cause)");
  }
}

int ManualDrive::motors_off() noexcept {
  if (heartbeat_ != nullptr) {
    heartbeat_->want_enable.store(0, std::memory_order_relaxed);
    heartbeat_->answered.store(heartbeat_->cut.load(std::memory_order_acquire), std::memory_order_relaxed);
  }
  return hardware_.motors_off();
}

void ManualDrive::beat() {
  if (heartbeat_ == nullptr) return;
  const std::int64_t now_ns = runtime::monotonic_now_ns();
  heartbeat_->loop_ns.store(now_ns, std::memory_order_release);
  if (heartbeat_->guard_is_dead(now_ns)) throw JobError("the guard process has died; motors are off");
  if (heartbeat_->cut.load(std::memory_order_acquire) != heartbeat_->answered.load(std::memory_order_relaxed))
    throw JobError(
        "a tick came too late and the guard has switched the motors off: end other programs, try again");
}

void ManualDrive::off() {
  if (motors_off() != 0)
    throw JobError("the motors cannot be switched off: take the battery out, then run equipoise doctor");
}

RawSample ManualDrive::sample() {
  off();
  return next();
}

RawSample ManualDrive::drive(const std::array<double, kMaxMotors>& duty) {
  MotorCommand command{};
  std::copy(duty.begin(), duty.end(), command.duty);
  command.enable = true;
  if (heartbeat_ != nullptr) heartbeat_->want_enable.store(1, std::memory_order_relaxed);
  const int status = hardware_.write(command);
  try {
    if (status != 0) throw JobError(std::string("the bridges refuse: ") + std::strerror(-status));
    return next();
  } catch (...) {
    (void)motors_off();
    throw;
  }
}

void ManualDrive::rest(double seconds) {
  for (int i = 0; i < std::lround(seconds * kTickHz); ++i) sample();
}

Stillness ManualDrive::hold_still(double seconds) {
  const int count = static_cast<int>(std::lround(seconds * kTickHz));
  Vec3 gyro_squares = Vec3::Zero(), first_half = Vec3::Zero();
  std::array<double, kMaxMotors> low{}, high{};
  Stillness s;
  for (int n = 0; n < count; ++n) {
    const RawSample raw = sample();
    const Eigen::Map<const Vec3> gyro(raw.gyro_counts);
    const Eigen::Map<const Vec3> accel(raw.accel_counts);
    // Welford's means keep the small spread of large numbers.
    const Vec3 gyro_step = gyro - s.gyro;
    s.gyro += gyro_step / (n + 1);
    s.accel += (accel - s.accel) / (n + 1);
    gyro_squares += gyro_step.cwiseProduct(gyro - s.gyro);
    if (n == count / 2 - 1) first_half = s.gyro;
    for (std::size_t i = 0; i < kMaxMotors; ++i) {
      low[i] = n == 0 ? raw.encoder_counts[i] : std::min(low[i], raw.encoder_counts[i]);
      high[i] = n == 0 ? raw.encoder_counts[i] : std::max(high[i], raw.encoder_counts[i]);
    }
  }
  s.gyro_sigma = (gyro_squares / count).cwiseSqrt();
  s.gyro_drift = 2.0 * (s.gyro - first_half);  // the whole is the mean of the halves
  for (std::size_t i = 0; i < kMaxMotors; ++i) s.encoder_travel[i] = high[i] - low[i];
  s.temperature_degC = temperature_degC_;
  return s;
}

std::string ManualDrive::ask(const Request& request) {
  off();
  std::string answer;
  if (!ask_(request, &answer)) throw JobError("cancelled; nothing was written");
  return answer;
}

}  // namespace equipoise::app
