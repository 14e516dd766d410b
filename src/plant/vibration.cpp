#include "equipoise/plant/vibration.hpp"

#include <cmath>

namespace equipoise {
namespace {

constexpr std::size_t kLines = 2;

/// x(t) = plateau(0) x(t-1) + plateau(1) x(t-2) + noise: a pole pair at this frequency and bandwidth.
Vec2 pole_pair(double centre_hz, double bandwidth_hz) noexcept {
  const double radius = std::exp(-kPi * bandwidth_hz * kTickS);
  return {2.0 * radius * std::cos(2.0 * kPi * centre_hz * kTickS), -radius * radius};
}

/// Sigma of the noise that gives it variance 1. Box, Jenkins, Reinsel, Time Series Analysis, (3.2.18).
double driving_sigma(const Vec2& a) noexcept {
  return std::sqrt((1.0 + a(1)) * ((1.0 - a(1)) * (1.0 - a(1)) - a(0) * a(0)) / (1.0 - a(1)));
}

}  // namespace

Vibration::Vibration(const VibrationParams& p, std::uint64_t seed, std::size_t wheels)
    : p_(p),
      wheels_(wheels),
      noise_(seed, kVibration),
      plateau_(pole_pair(p.centre_hz, p.bandwidth_hz)),
      kick_(driving_sigma(plateau_)),
      // Of a Gaussian times exp(s z): kurtosis 3 exp(4 s^2).
      log_sigma_(0.5 * std::sqrt(std::log1p(p.excess_kurtosis / 3.0))),
      envelope_keep_(std::exp(-kTickS / p.burst_s)),
      envelope_kick_(std::sqrt(1.0 - envelope_keep_ * envelope_keep_)) {
  const double amplitude = std::sqrt(2.0 / static_cast<double>(kLines * wheels));
  for (int axis = 0; axis < 6; ++axis) {
    for (std::size_t k = 0; k < kLines * wheels; ++k) {
      const double phase = noise_.uniform(0.0, 2.0 * kPi);
      lines_(axis, static_cast<int>(2 * k)) = amplitude * std::cos(phase);
      lines_(axis, static_cast<int>(2 * k + 1)) = amplitude * std::sin(phase);
    }
  }
}

Vibration::Shaken Vibration::update(double time_s, const Vec<kMaxMotors>& wheel_angle_rad) {
  double rate_rad_s = 0.0;
  Vec<4 * kMaxMotors> phases = Vec<4 * kMaxMotors>::Zero();
  for (std::size_t wheel = 0; wheel < wheels_; ++wheel) {
    const double angle = wheel_angle_rad(static_cast<int>(wheel));
    if (time_s_ >= 0.0 && time_s > time_s_)
      rate_rad_s += std::abs(angle - angle_rad_[wheel]) / ((time_s - time_s_) * static_cast<double>(wheels_));
    angle_rad_[wheel] = angle;
    for (std::size_t line = 0; line < kLines; ++line) {
      const int at = static_cast<int>(2 * (kLines * wheel + line));
      const double turned = p_.lines_per_turn(static_cast<int>(line)) * angle;
      phases(at) = std::sin(turned);
      phases(at + 1) = std::cos(turned);
    }
  }
  time_s_ = time_s;
  const Vec6 plateau = plateau_(0) * before_ + plateau_(1) * before_that_ + noise_.gaussian_vector<6>(kick_);
  before_that_ = before_;
  before_ = plateau;
  envelope_ = envelope_keep_ * envelope_ + noise_.gaussian(envelope_kick_);
  const double burst = std::exp(log_sigma_ * envelope_ - log_sigma_ * log_sigma_);  // mean square 1
  const Vec6 unit =
      burst * (std::sqrt(1.0 - p_.line_share) * plateau + std::sqrt(p_.line_share) * (lines_ * phases));
  return {
      unit.head<3>().cwiseProduct(p_.gyro_sigma_rad_s) * rate_rad_s / (rate_rad_s + p_.gyro_half_rate_rad_s),
      unit.tail<3>().cwiseProduct(p_.accel_sigma_m_s2) * rate_rad_s /
          (rate_rad_s + p_.accel_half_rate_rad_s)};
}

}  // namespace equipoise
