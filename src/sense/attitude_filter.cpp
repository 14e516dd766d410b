#include "equipoise/sense/attitude_filter.hpp"

namespace equipoise {
namespace {

Eigen::Quaterniond turn(const Vec3& angle) noexcept {
  const double half = 0.5 * angle.norm();
  const double scale = half > 1e-9 ? 0.5 * std::sin(half) / half : 0.5;
  return {std::cos(half), scale * angle.x(), scale * angle.y(), scale * angle.z()};
}

constexpr double kDegree = kPi / 180.0;

double square(double x) noexcept { return x * x; }

}  // namespace

template <int N>
VectorLowPass<N>::VectorLowPass(double time_constant_s, double tick_s) noexcept
    : warm_up_(static_cast<int>(std::lround(time_constant_s / tick_s))) {
  // Bilinear transform of a damping of 1/sqrt(2), cut off at sqrt(2)/(2 pi tau).
  const double c = std::tan(tick_s / (std::sqrt(2.0) * time_constant_s));
  const double d = c * c + std::sqrt(2.0) * c + 1.0;
  b0_ = c * c / d;
  a1_ = 2.0 * (c * c - 1.0) / d;
  a2_ = (1.0 - std::sqrt(2.0) * c + c * c) / d;
}

template <int N>
const Vec<N>& VectorLowPass<N>::update(const Vec<N>& x) noexcept {
  if (samples_ < warm_up_) {
    ++samples_;
    sum_ += x;
    y_ = sum_ / samples_;
    // The state in which a constant y_ stays y_.
    s2_ = (b0_ - a2_) * y_;
    s1_ = (1.0 - b0_) * y_;
    return y_;
  }
  y_ = b0_ * x + s1_;
  s1_ = 2.0 * b0_ * x - a1_ * y_ + s2_;
  s2_ = b0_ * x - a2_ * y_;
  return y_;
}

template class VectorLowPass<2>;
template class VectorLowPass<3>;
template class VectorLowPass<9>;

AttitudeFilter::AttitudeFilter(const Params& params) noexcept
    : p_(params),
      force_average_(params.accel_time_constant_s, params.tick_s),
      rotation_average_(params.accel_time_constant_s, params.tick_s),
      turned_bias_average_(params.accel_time_constant_s, params.tick_s),
      gyro_slow_(0.5, params.tick_s),
      gyro_fast_(0.05, params.tick_s),
      force_slow_(0.5, params.tick_s),
      force_fast_(0.05, params.tick_s),
      P_(Mat3::Identity() * params.bias_sigma_initial_rad_s * params.bias_sigma_initial_rad_s) {}

void AttitudeFilter::detect_rest(const Vec3& gyro, const Vec3& force) noexcept {
  // Two averages, a fast one because a chip's noise may exceed the limits.
  rest_gyro_mean_ = gyro_slow_.update(gyro);
  const Vec3 force_mean = force_slow_.update(force);
  const bool still = (gyro_fast_.update(gyro) - rest_gyro_mean_).norm() < p_.rest_rate_rad_s &&
                     (force_fast_.update(force) - force_mean).norm() < p_.rest_accel_m_s2 &&
                     rest_gyro_mean_.cwiseAbs().maxCoeff() < p_.bias_limit_rad_s;
  rest_s_ = still ? rest_s_ + p_.tick_s : 0.0;
  at_rest_ = rest_s_ >= p_.rest_after_s;
}

/// Turns the averaged specific force upright.
void AttitudeFilter::correct_inclination(const Vec3& force) noexcept {
  const Vec3 average_I = force_average_.update(q_IB_ * force);
  const Vec3 up = (q_EI_ * average_I).normalized();
  if (!up.allFinite()) return;
  estimate_bias(up);
  Eigen::Quaterniond step;
  const double w = std::sqrt(0.5 * (up.z() + 1.0));
  if (w > 1e-6) {
    step = Eigen::Quaterniond(w, 0.5 * up.y() / w, -0.5 * up.x() / w, 0.0);
  } else {
    step = Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  }
  q_EI_ = (step * q_EI_).normalized();
}

/// The inclination correction of this tick, as a rate, is what the gyro's bias still does to the average. Its
/// vertical part is invisible without motion and decays.
void AttitudeFilter::estimate_bias(const Vec3& up) noexcept {
  const double wander = square(0.1 * kDegree) * p_.tick_s / p_.bias_forgetting_s;
  P_.diagonal().array() += wander;
  // Measurement variance at which the bias's own settles at p.
  const auto settling_at = [wander](double p) { return p * p / wander + p; };

  const Mat3 R = q_EB().toRotationMatrix();
  Vec<9> flat;
  flat << R.row(0).transpose(), R.row(1).transpose(), R.row(2).transpose();
  const Vec<9> average = rotation_average_.update(flat);
  const Vec3 turned = R * bias_;
  const Vec2 turned_average = turned_bias_average_.update(turned.head<2>());

  Mat3 H;
  Vec3 e;
  Vec3 W;
  if (at_rest_) {
    H = Mat3::Identity();
    e = rest_gyro_mean_ - bias_;
    W.setConstant(settling_at(square(p_.bias_sigma_rest_rad_s)));
  } else {
    H.row(0) = average.head<3>().transpose();
    H.row(1) = average.segment<3>(3).transpose();
    H.row(2) = average.tail<3>().transpose();
    const Vec3 predicted = H * bias_;
    e << -up.y() / p_.tick_s + turned_average.x() - predicted.x(),
        up.x() / p_.tick_s + turned_average.y() - predicted.y(), -predicted.z();
    const double w = settling_at(square(p_.bias_sigma_motion_rad_s));
    W << w, w, 1e4 * w;
  }
  e = e.cwiseMax(-p_.bias_limit_rad_s).cwiseMin(p_.bias_limit_rad_s);
  for (int i = 0; i < 3; ++i) {  // one scalar at a time: W is diagonal
    const Vec3 h = H.row(i).transpose();
    const Vec3 Ph = P_ * h;
    const double s = h.dot(Ph) + W(i);
    const Vec3 k = Ph / s;
    bias_ += k * e(i);
    P_ -= k * Ph.transpose();
    for (int j = i + 1; j < 3; ++j) e(j) -= H.row(j).dot(k) * e(i);
  }
  P_ = 0.5 * (P_ + P_.transpose()).eval();
  bias_ = bias_.cwiseMax(-p_.bias_limit_rad_s).cwiseMin(p_.bias_limit_rad_s);
}

void AttitudeFilter::update(const Vec3& gyro_B, const Vec3& force_B) noexcept {
  if (!gyro_B.allFinite() || !force_B.allFinite()) return;
  const Vec3 rate = gyro_B - bias_;
  Vec3 force = force_B;
  if (started_) {  // acceleration of the IMU about the point that moves least
    const Vec3 rate_dot = (gyro_B - gyro_previous_) / p_.tick_s;
    force -= rate_dot.cross(p_.lever_arm_B_m) + rate.cross(rate.cross(p_.lever_arm_B_m));
  }
  gyro_previous_ = gyro_B;
  detect_rest(gyro_B, force_B);
  if (!started_) {
    started_ = true;
  } else {
    q_IB_ = (q_IB_ * turn(rate * p_.tick_s)).normalized();
  }
  correct_inclination(force);
}

void AttitudeFilter::update_magnetometer(const Vec3& field_B) noexcept {
  const double norm = field_B.norm();
  if (!(norm > 0.0)) return;
  const Vec3 field = q_EB() * field_B;
  const double dip = std::asin(-field.z() / norm);
  const bool first = field_norm_ == 0.0;
  if (first) {
    field_norm_ = norm;
    field_dip_ = dip;
  }
  if (std::abs(norm - field_norm_) > p_.mag_norm_tolerance * field_norm_ ||
      std::abs(dip - field_dip_) > p_.mag_dip_tolerance_rad) {
    return;  // iron or current nearby: the gyro carries the heading
  }
  mag_s_ += p_.tick_s;
  const double keep = 1.0 - std::exp(-p_.tick_s / p_.mag_time_constant_s);
  const double gain = std::fmax(keep, p_.tick_s / mag_s_);  // a plain mean first
  const double to_north = std::atan2(field.x(), field.y());
  q_EI_ = (Eigen::Quaterniond(Eigen::AngleAxisd(gain * to_north, Vec3::UnitZ())) * q_EI_).normalized();
}

}  // namespace equipoise
