#include "app/sim/run_meter.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise::app {
namespace {

constexpr double kFallenTilt_rad = 0.6;

}  // namespace

double RunMeter::Rms::value() const {
  return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : 0.0;
}

void RunMeter::motors(const MotorCommand& motors, bool saturated) {
  if (!motors.enable) return;
  ++driven_;
  saturated_ += saturated ? 1 : 0;
  for (const double duty : motors.duty) duty_max_ = std::max(duty_max_, std::abs(duty));
}

void RunMeter::path(double time_s, const StateView& reference, const StateView& truth) {
  position_.add((reference.position_W_m - truth.position_W_m).squaredNorm(), 1);
  if (yaw_from_s_ < 0.0) {
    yaw_from_s_ = time_s;
    yaw_from_ = truth.theta_rad.z();
  }
  yaw_to_s_ = time_s;
  yaw_to_ = truth.theta_rad.z();
}

bool RunMeter::upright(double time_s, ArmState arm, std::uint32_t reasons, const StateView& truth) {
  const bool lost = time_s > kArmAt_s + 0.1 && arm != ArmState::kArmed;
  if (!lost && truth.theta_rad.head<2>().norm() <= kFallenTilt_rad) return true;
  fell_at_s_ = time_s;
  reasons_ = reasons;
  return false;
}

SimSummary RunMeter::summary(std::int64_t ticks, double wall_s) const {
  SimSummary s;
  s.fell = fell_at_s_ >= 0.0;
  s.fell_at_s = fell_at_s_;
  s.reasons = reasons_;
  s.controlling = controlling_.value();
  s.position_rmse_m = position_.value();
  s.duty_max = duty_max_;
  s.saturated_fraction = driven_ > 0 ? static_cast<double>(saturated_) / static_cast<double>(driven_) : 0.0;
  if (yaw_to_s_ > yaw_from_s_ && yaw_from_s_ >= 0.0) {
    s.yaw_rate_mean_hz = (yaw_to_ - yaw_from_) / (2.0 * kPi * (yaw_to_s_ - yaw_from_s_));
  }
  s.ticks = ticks;
  s.real_time_factor = static_cast<double>(ticks) * kTickS / wall_s;
  return s;
}

}  // namespace equipoise::app
