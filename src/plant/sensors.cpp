#include "equipoise/plant/sensors.hpp"

#include <algorithm>

namespace equipoise {

std::array<double, 4> quaternion_of(const Vec3& theta) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(theta.z(), Vec3::UnitZ()) *
                               Eigen::AngleAxisd(theta.y(), Vec3::UnitY()) *
                               Eigen::AngleAxisd(theta.x(), Vec3::UnitX());
  return {q.w(), q.x(), q.y(), q.z()};
}

Mat3 turned_by(const Vec3& rotation_rad) noexcept {
  const double angle = rotation_rad.norm();
  return angle == 0.0 ? Mat3::Identity() : Eigen::AngleAxisd(angle, rotation_rad / angle).toRotationMatrix();
}

Vec2 push_force_W(const WorldParams& world, double time_s) noexcept {
  Vec2 force = Vec2::Zero();
  for (const Push& push : world.pushes) {
    if (time_s >= push.at_s && time_s < push.at_s + push.duration_s) force += push.force_W_N;
  }
  const RandomPushes& random = world.random_pushes;
  const double interval = random.every_s > 0.0 ? std::floor(time_s / random.every_s) : 0.0;
  if (interval >= 1.0) {
    const auto k = static_cast<std::int64_t>(interval);
    const double begins_at_s =
        interval * random.every_s + hashed_unit(world.seed, k, 1) * (random.every_s - random.duration_s);
    const double direction = 2.0 * kPi * hashed_unit(world.seed, k, 2);
    if (time_s >= begins_at_s && time_s < begins_at_s + random.duration_s)
      force += random.force_N * Vec2(std::cos(direction), std::sin(direction));
  }
  return force;
}

SimulatedSensors::SimulatedSensors(const Calibration& calibration, const WorldParams& world, int wheels,
                                   NoiseStream& start, const Vec3& theta_rad)
    : calibration_(calibration),
      world_(world),
      wheels_(static_cast<std::size_t>(wheels)),
      gyro_noise_(world.seed, kGyroNoise),
      accel_noise_(world.seed, kAccelNoise),
      encoder_noise_(world.seed, kEncoderNoise),
      attitude_noise_(world.seed, kAttitudeNoise),
      vibration_(world.vibration, world.seed, static_cast<std::size_t>(wheels)),
      attitude_keep_(std::exp(-kTickS / world.attitude_time_constant_s)),
      attitude_kick_rad_(world.attitude_sigma_rad * std::sqrt(1.0 - attitude_keep_ * attitude_keep_)),
      heading_kick_rad_(world.attitude_heading_drift_rad_sqrt_s * std::sqrt(kTickS)) {
  aged_ = world.aged();
  encoder_noisy_ = world.encoder_sigma_rad != 0.0 || !world.quantise;  // else a zero's sign might differ
  const Vec3 chassis(world.com_offset_rad.x(), world.com_offset_rad.y(), 0.0);
  misaligned_ = !world.imu_misalignment_rad.isZero(0.0) || !chassis.isZero(0.0);
  R_misaligned_ = turned_by(chassis) * turned_by(world.imu_misalignment_rad);
  q_mounted_ = Mat3(R_misaligned_ * calibration.R_BS);
  gyro_bias_ = start.gaussian_vector<3>(world.gyro_bias_sigma_rad_s);
  accel_bias_ = start.gaussian_vector<3>(world.accel_bias_sigma_m_s2);
  attitude_history_.fill(theta_rad);
}

void SimulatedSensors::attitude_packet(const Vec3& theta_rad, RawSample* raw) {
  attitude_error_.head<2>() =
      attitude_keep_ * attitude_error_.head<2>() + attitude_noise_.gaussian_vector<2>(attitude_kick_rad_);
  attitude_error_.z() += attitude_noise_.gaussian(heading_kick_rad_);
  attitude_head_ = (attitude_head_ + 1) % kAttitudeDelay;
  attitude_history_[attitude_head_] = theta_rad + attitude_error_;
  const auto delay = static_cast<std::size_t>(world_.attitude_latency_ticks);
  const Vec3 attitude = attitude_history_[(attitude_head_ + kAttitudeDelay - delay) % kAttitudeDelay];
  const auto [w, x, y, z] = quaternion_of(attitude);
  const Eigen::Quaterniond q = Eigen::Quaterniond(w, x, y, z) * q_mounted_;
  raw->attitude_wxyz[0] = q.w();
  raw->attitude_wxyz[1] = q.x();
  raw->attitude_wxyz[2] = q.y();
  raw->attitude_wxyz[3] = q.z();
}

RawSample SimulatedSensors::sense(const TrueMotion& m) {
  const auto late = std::min(static_cast<std::size_t>(world_.sensor_latency_ticks), samples_);
  const double imu_sample = std::floor(m.time_s / imu_period_s());
  const bool repeats = world_.imu_repeat_share > 0.0 && samples_ > 0 && imu_sample == imu_sample_;
  imu_sample_ = imu_sample;
  RawSample now = sense_now(aged_ ? as_felt(m) : m);
  if (repeats) {
    const RawSample& before = sampled_[(samples_ - 1) % kSampleDelay];
    std::copy(std::begin(before.gyro_counts), std::end(before.gyro_counts), std::begin(now.gyro_counts));
    std::copy(std::begin(before.accel_counts), std::end(before.accel_counts), std::begin(now.accel_counts));
  }
  sampled_[samples_ % kSampleDelay] = now;
  RawSample raw = sampled_[(samples_ - late) % kSampleDelay];
  ++samples_;
  raw.t_ns = now.t_ns;
  return raw;
}

/// The motion with each sensor's own age.
TrueMotion SimulatedSensors::as_felt(const TrueMotion& m) noexcept {
  past_.add(m);
  TrueMotion felt = m;
  const double imu_at_s = world_.imu_repeat_share > 0.0 ? imu_sample_ * imu_period_s() : m.time_s;
  felt.omega_B_rad_s = past_.value(imu_at_s - world_.gyro_age_s(), &Felt::omega_B_rad_s);
  felt.specific_force_B_m_s2 = past_.value(imu_at_s - world_.accel_age_s(), &Felt::specific_force_B_m_s2);
  felt.wheel_angle_rad = past_.value(m.time_s - world_.encoder_sample_age_s, &Felt::wheel_angle_rad);
  return felt;
}

RawSample SimulatedSensors::sense_now(const TrueMotion& m) {
  const auto as_mounted = [this](const Vec3& v) {
    return misaligned_ ? Vec3(R_misaligned_.transpose() * v) : v;
  };
  Vec3 gyro =
      as_mounted(m.omega_B_rad_s) + gyro_bias_ + gyro_noise_.gaussian_vector<3>(world_.gyro_sigma_rad_s);
  Vec3 accel = as_mounted(m.specific_force_B_m_s2) + accel_bias_ +
               accel_noise_.gaussian_vector<3>(world_.accel_sigma_m_s2);
  if (world_.vibration.on()) {
    const Vibration::Shaken shaken = vibration_.update(m.time_s, m.wheel_angle_rad);
    gyro += shaken.gyro_rad_s;
    accel += shaken.accel_m_s2;
  }
  gyro += world_.gyro_scale_error.cwiseProduct(gyro);
  if (!world_.gyro_drift_rad_s.isZero(0.0))
    gyro -= world_.gyro_drift_rad_s * std::expm1(-m.time_s / world_.warm_up_s);
  if (!world_.gyro_drift_rad_s_K.isZero(0.0))
    gyro += world_.gyro_drift_rad_s_K *
            (world_.warm_K - world_.warm_up_K * std::expm1(-m.time_s / world_.warm_up_s));
  accel += world_.accel_scale_error.cwiseProduct(accel);

  const auto counts = [this](double value, double per_count) {
    const double n = value / per_count;
    return world_.quantise ? std::floor(n + 0.5) : n;
  };
  constexpr double kImuRange = 32767.0;
  const auto imu_counts = [&](double value, double per_count) {
    const double n = counts(value, per_count);
    return world_.quantise ? std::clamp(n, -kImuRange - 1.0, kImuRange) : n;
  };
  const Vec3 gyro_S = calibration_.R_BS.transpose() * (gyro + calibration_.gyro_bias_B_rad_s);
  const Vec3 accel_S = (calibration_.R_BS.transpose() * (accel + calibration_.accel_bias_B_m_s2))
                           .cwiseQuotient(calibration_.accel_scale_S);

  RawSample raw{};
  raw.t_ns = static_cast<std::int64_t>(std::llround(m.time_s * 1e9));
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    raw.gyro_counts[k] = imu_counts(gyro_S(i), calibration_.gyro_rad_s_per_count);
    raw.accel_counts[k] = imu_counts(accel_S(i), calibration_.accel_m_s2_per_count);
  }
  for (std::size_t k = 0; k < wheels_; ++k) {
    double angle = m.wheel_angle_rad(static_cast<int>(k));
    if (encoder_noisy_) angle += encoder_noise_.gaussian(world_.encoder_sigma_rad);
    raw.encoder_counts[k] =
        counts(calibration_.encoder_sign[k] * angle, 2.0 * kPi / calibration_.encoder_counts_per_rev);
  }
  raw.battery_counts = counts(m.battery_V - calibration_.battery_offset_V, calibration_.battery_V_per_count);
  if (attitude_read_) attitude_packet(m.theta_rad, &raw);
  raw.valid = RIO_IMU | RIO_ENCODERS | RIO_BATTERY | RIO_ATTITUDE;
  return raw;
}

}  // namespace equipoise
