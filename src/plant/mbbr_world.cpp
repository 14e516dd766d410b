#include "equipoise/plant/mbbr_world.hpp"

#include <algorithm>

namespace equipoise {
namespace {

enum Effect : std::uint64_t { kStart = 1, kProcess, kGyro, kAccel, kEncoder, kAttitude };

enum At : int { kTheta = 0, kOmega = 3, kPhiDot = 6, kPhi = 8, kRelative = 10 };

/// Quaternion of Rz Ry Rx.
std::array<double, 4> quaternion(const Vec3& theta) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(theta.z(), Vec3::UnitZ()) *
                               Eigen::AngleAxisd(theta.y(), Vec3::UnitY()) *
                               Eigen::AngleAxisd(theta.x(), Vec3::UnitX());
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace

MbbrWorld::MbbrWorld(const MbbrParameters& robot, const MotorParameters& motor,
                     const Calibration& calibration, const WorldParams& world)
    : robot_(robot),
      motor_(motor),
      calibration_(calibration),
      world_(world),
      kinematics_(robot),
      dynamics_(robot),
      mobility_(dynamics_.relative_mobility()),
      drive_(robot, motor, world.disturbance),
      start_noise_(world.seed, kStart),
      process_noise_(world.seed, kProcess),
      gyro_noise_(world.seed, kGyro),
      accel_noise_(world.seed, kAccel),
      encoder_noise_(world.seed, kEncoder),
      attitude_noise_(world.seed, kAttitude),
      battery_V_(world.battery_V) {
  s_.segment<3>(kTheta) = start_noise_.gaussian_vector<3>(world.initial_tilt_rad);
  gyro_bias_ = start_noise_.gaussian_vector<3>(world.gyro_bias_sigma_rad_s);
  accel_bias_ = start_noise_.gaussian_vector<3>(world.accel_bias_sigma_m_s2);
  attitude_history_.fill(s_.segment<3>(kTheta));
  const Vec3& tilt = world.disturbance.imu_misalignment_rad;
  R_imu_ = world.disturbed && !tilt.isZero(0.0)
               ? Mat3(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()).toRotationMatrix())
               : Mat3(Mat3::Identity());
}

MbbrMotion MbbrWorld::motion(const State& s) noexcept {
  MbbrMotion m;
  m.theta_xy = s.segment<2>(kTheta);
  m.omega_B = s.segment<3>(kOmega);
  m.phi_dot_star = s.segment<2>(kPhiDot);
  return m;
}

Vec3 MbbrWorld::motor_torque_B(const Vec3& relative_rate_B) const noexcept {
  if (!command_.enable) return Vec3::Zero();  // all switches open: the current decays at once
  if (world_.disturbed) return drive_.torque_B(relative_rate_B, signed_duty(), battery_V_);
  const Vec3 wheel_rate = kinematics_.wheels_from_ball(relative_rate_B);
  const double stall_torque = motor_.torque_constant_N_m_A * motor_.stall_current_A(battery_V_);
  const double no_load = motor_.no_load_rad_s(battery_V_);
  Vec3 torque;
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double duty = calibration_.motor_sign[k] * command_.duty[k];
    const double omega_r = wheel_rate(i) / no_load;
    const double current = motor_.bridge == BridgeType::kDriveBrake
                               ? duty - omega_r
                               : drive_coast_mean_current(motor_.T_r(), omega_r, duty);
    torque(i) = stall_torque * current;
  }
  return kinematics_.axes_from_wheels(torque);
}

MbbrWorld::State MbbrWorld::derivative(const State& s, const Vec3& friction_B,
                                       const Vec2& push_W) const noexcept {
  const MbbrMotion m = motion(s);
  const Vec3 relative = MbbrDynamics::encoder_rate_B(m);
  Vec3 tau = motor_torque_B(relative) + friction_B;
  if (world_.friction) tau -= viscous_N_m_s() * relative;
  const double theta_z = s(kTheta + 2);
  Vec3 push_B = Vec3::Zero();
  if (!push_W.isZero(0.0)) {
    const Mat3 R_WB = rotation(quaternion(s.segment<3>(kTheta)));
    push_B = R_WB.transpose() * Vec3(push_W.x(), push_W.y(), 0.0);
  }
  const MbbrAccelerations a = dynamics_.accelerations(m, tau, push_B, slope_pull_star(theta_z));
  State d;
  d.segment<3>(kTheta) = euler_rates(m.theta_xy, m.omega_B);
  d.segment<3>(kOmega) = a.omega_dot_B;
  d.segment<2>(kPhiDot) = MbbrDynamics::phi_star_ddot(m, a);
  d.segment<2>(kPhi) = rotate(theta_z, m.phi_dot_star);
  d.segment<3>(kRelative) = world_.disturbed ? drive_.seen_rate_B(relative) : relative;
  return d;
}

/// Per axis, the constant torque that would end this step at rest, limited to mu_c: sticking and sliding in
/// one rule.
Vec3 MbbrWorld::coulomb_torque_B(const State& s, const Vec2& push_W) const noexcept {
  if (!world_.friction) return Vec3::Zero();
  const MbbrMotion m = motion(s);
  const State d = derivative(s, Vec3::Zero(), push_W);
  MbbrMotion next = m;
  next.theta_xy += world_.step_s * d.segment<2>(kTheta);
  next.omega_B += world_.step_s * d.segment<3>(kOmega);
  next.phi_dot_star += world_.step_s * d.segment<2>(kPhiDot);
  const Vec3 free = MbbrDynamics::encoder_rate_B(next);
  const Vec3 limit =
      world_.disturbed ? friction_limit_N_m(world_.disturbance, robot_.mu_c, MbbrDynamics::encoder_rate_B(m))
                       : Vec3(Vec3::Constant(robot_.mu_c));
  Vec3 tau;
  for (int i = 0; i < 3; ++i) {
    tau(i) = std::clamp(-free(i) / (world_.step_s * mobility_(i)), -limit(i), limit(i));
  }
  return tau;
}

Vec2 MbbrWorld::push_now() const noexcept {
  Vec2 force = Vec2::Zero();
  for (const Push& push : world_.pushes) {
    if (time_s_ >= push.at_s && time_s_ < push.at_s + push.duration_s) force += push.force_W_N;
  }
  return force;
}

void MbbrWorld::update_battery() noexcept {
  if (world_.battery_resistance_ohm == 0.0) return;
  // Mean supply current of a bridge is |duty| times the motor current while driven.
  double supply_A = 0.0;
  if (command_.enable) {
    const Vec3 wheel_rate = kinematics_.wheels_from_ball(MbbrDynamics::encoder_rate_B(motion(s_)));
    for (int i = 0; i < Mbbr::kWheels; ++i) {
      const double duty = command_.duty[static_cast<std::size_t>(i)];
      const double omega_r = wheel_rate(i) / motor_.no_load_rad_s(battery_V_);
      supply_A += std::abs(duty * motor_.stall_current_A(battery_V_) * (duty - omega_r));
    }
  }
  battery_V_ = world_.battery_V - world_.battery_resistance_ohm * supply_A;
}

void MbbrWorld::disturb() {
  if (world_.process_noise_sigma.isZero(0.0)) return;
  Vec<10> v;
  for (int i = 0; i < 10; ++i) v(i) = process_noise_.gaussian(world_.process_noise_sigma(i));
  const MbbrMotion before = motion(s_);
  Vec3 theta_dot = euler_rates(before.theta_xy, before.omega_B);
  s_.segment<3>(kTheta) += v.head<3>();
  theta_dot += v.segment<3>(5);
  s_.segment<3>(kOmega) = body_rates(s_.segment<2>(kTheta), theta_dot);
  s_.segment<2>(kPhiDot) += v.tail<2>();
  s_.segment<2>(kPhi) += rotate(s_(kTheta + 2), Vec2(v(3), v(4)));
  s_.segment<2>(kRelative) += Vec2(v(3) - v(0), v(4) - v(1));
  s_(kRelative + 2) -= v(2);
}

Vec3 MbbrWorld::signed_duty() const noexcept {
  Vec3 duty;
  for (std::size_t k = 0; k < 3; ++k) {
    duty(static_cast<int>(k)) = calibration_.motor_sign[k] * command_.duty[k];
  }
  return duty;
}

double MbbrWorld::viscous_N_m_s() const noexcept {
  return world_.disturbed ? robot_.mu_v + world_.disturbance.extra_viscous_N_m_s : robot_.mu_v;
}

/// A slope pulls the whole robot downhill at the ball: F = -(m_t + m_b) g slope.
Vec2 MbbrWorld::slope_pull_star(double theta_z) const noexcept {
  if (!world_.disturbed || world_.disturbance.floor_slope_rad.isZero(0.0)) return Vec2::Zero();
  const double weight = (robot_.m_t + robot_.m_b) * kGravity_m_s2;
  return rotate(-theta_z, Vec2(-weight * world_.disturbance.floor_slope_rad));
}

void MbbrWorld::advance(const MotorCommand& command) {
  const int late = world_.disturbed ? world_.disturbance.actuation_latency_steps : 0;
  if (late == 0) command_ = command;
  if (command.enable) held_ = false;
  const int steps = static_cast<int>(std::lround(kTickS / world_.step_s));
  for (int i = 0; i < steps && !held_; ++i) {
    const double h = world_.step_s;
    if (i == late) command_ = command;
    if (world_.disturbed) {
      const Vec3 relative = MbbrDynamics::encoder_rate_B(motion(s_));
      const Vec3 wheels = kinematics_.wheels_from_ball(s_.segment<3>(kRelative));
      drive_.begin_step(
          {relative, wheels, command_.enable ? signed_duty() : Vec3(Vec3::Zero()), battery_V_, h});
    }
    const Vec2 push = push_now();
    const Vec3 friction = coulomb_torque_B(s_, push);
    const State k1 = derivative(s_, friction, push);
    const State k2 = derivative(s_ + 0.5 * h * k1, friction, push);
    const State k3 = derivative(s_ + 0.5 * h * k2, friction, push);
    const State k4 = derivative(s_ + h * k3, friction, push);
    s_ += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    time_s_ += h;
  }
  if (held_) {
    time_s_ += kTickS;
  } else {
    disturb();
  }
  update_battery();
}

void MbbrWorld::sense_attitude() {
  const double tau = world_.attitude_time_constant_s;
  const double keep = std::exp(-kTickS / tau);
  const double kick = world_.attitude_sigma_rad * std::sqrt(1.0 - keep * keep);
  attitude_error_.head<2>() = keep * attitude_error_.head<2>() + attitude_noise_.gaussian_vector<2>(kick);
  attitude_error_.z() +=
      attitude_noise_.gaussian(world_.attitude_heading_drift_rad_sqrt_s * std::sqrt(kTickS));
  attitude_head_ = (attitude_head_ + 1) % kAttitudeDelay;
  attitude_history_[attitude_head_] = s_.segment<3>(kTheta) + attitude_error_;
}

RawSample MbbrWorld::sense() {
  const auto late = static_cast<std::size_t>(world_.disturbed ? world_.disturbance.sensor_latency_ticks : 0);
  const RawSample now = sense_now();
  sensed_[sensed_count_ % kSensorDelay] = now;
  RawSample raw = sensed_[(sensed_count_ - std::min(late, sensed_count_)) % kSensorDelay];
  ++sensed_count_;
  raw.t_ns = now.t_ns;
  return raw;
}

RawSample MbbrWorld::sense_now() {
  const MbbrMotion m = motion(s_);
  Vec3 specific_force;
  if (held_) {
    specific_force = rotation(quaternion(s_.segment<3>(kTheta))).transpose() * Vec3(0.0, 0.0, kGravity_m_s2);
  } else {
    const Vec3 relative = MbbrDynamics::encoder_rate_B(m);
    const Vec2 push = push_now();
    Vec3 tau = motor_torque_B(relative) + coulomb_torque_B(s_, push);
    if (world_.friction) tau -= viscous_N_m_s() * relative;
    const Vec2 pull = slope_pull_star(s_(kTheta + 2));
    specific_force = -dynamics_.accelerometer_B(m, dynamics_.accelerations(m, tau, Vec3::Zero(), pull));
  }
  const Vec3 gyro =
      R_imu_.transpose() * m.omega_B + gyro_bias_ + gyro_noise_.gaussian_vector<3>(world_.gyro_sigma_rad_s);
  const Vec3 accel = R_imu_.transpose() * specific_force + accel_bias_ +
                     accel_noise_.gaussian_vector<3>(world_.accel_sigma_m_s2);
  Vec3 wheels = kinematics_.wheels_from_ball(s_.segment<3>(kRelative)) +
                encoder_noise_.gaussian_vector<3>(world_.encoder_sigma_rad);
  if (world_.disturbed) wheels += drive_.encoder_offset_rad();
  sense_attitude();

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
  const Vec3 accel_S = calibration_.R_BS.transpose() * (accel + calibration_.accel_bias_B_m_s2);

  RawSample raw;
  raw.t_ns = static_cast<std::int64_t>(std::llround(time_s_ * 1e9));
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    raw.gyro_counts[k] = imu_counts(gyro_S(i), calibration_.gyro_rad_s_per_count);
    raw.accel_counts[k] = imu_counts(accel_S(i), calibration_.accel_m_s2_per_count);
    raw.encoder_counts[k] =
        counts(calibration_.encoder_sign[k] * wheels(i), 2.0 * kPi / calibration_.encoder_counts_per_rev);
  }
  raw.battery_counts = counts(battery_V_ - calibration_.battery_offset_V, calibration_.battery_V_per_count);
  const auto delay = static_cast<std::size_t>(world_.attitude_latency_ticks);
  const Vec3 attitude = attitude_history_[(attitude_head_ + kAttitudeDelay - delay) % kAttitudeDelay];
  const Eigen::Quaterniond q(rotation(quaternion(attitude)) * calibration_.R_BS);
  raw.attitude_wxyz = {q.w(), q.x(), q.y(), q.z()};
  raw.imu_ok = raw.encoders_ok = raw.battery_ok = raw.attitude_ok = true;
  return raw;
}

MbbrEstimate MbbrWorld::truth() const noexcept {
  MbbrEstimate x;
  x.theta_xy = s_.segment<2>(kTheta);
  x.theta_z = s_(kTheta + 2);
  x.omega_B = s_.segment<3>(kOmega);
  x.theta_dot = euler_rates(x.theta_xy, x.omega_B);
  x.phi_dot_star = s_.segment<2>(kPhiDot);
  x.phi = s_.segment<2>(kPhi);
  return x;
}

}  // namespace equipoise
