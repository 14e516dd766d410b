#include <algorithm>
#include <cmath>

#include "app/sim/simulate.hpp"

namespace equipoise::app {

double RunMeter::Rms::value() const {
  return count_ > 0 ? std::sqrt(sum_ / static_cast<double>(count_)) : kUncounted;
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

void RunMeter::following(const PathPoint& path, const Vec2& forward_W_m) {
  if (following_.empty()) path_start_W_m_ = forward_W_m - path.position_W_m;
  following_.add((forward_W_m - path_start_W_m_ - path.position_W_m).squaredNorm(), 1);
}

void RunMeter::rolling(const StateView& estimate, const StateView& truth, int axes) {
  rolling_.add((estimate.phi_dot_rad_s - truth.phi_dot_rad_s).squaredNorm(), axes);
}

void RunMeter::innovation(const StateView& estimate) {
  innovation_sum_ += estimate.normalized_innovation;
  ++innovations_;
}

void RunMeter::heading(const StateView& estimate, const StateView& truth) {
  heading_error_ = estimate.theta_rad.z() - truth.theta_rad.z();
}

SimSummary RunMeter::summary(const Verdict& verdict, std::int64_t ticks, double wall_s) const {
  SimSummary s;
  s.verdict = verdict;
  s.controlling = controlling_.value();
  s.position_rmse_m = position_.value();
  s.path_rmse_m = following_.value();
  s.yaw_frame_speed_rmse_m_s = rolling_radius_m_ * rolling_.value();
  s.heading_error_rad = heading_error_;
  if (innovations_ > 0) s.normalized_innovation_mean = innovation_sum_ / static_cast<double>(innovations_);
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
