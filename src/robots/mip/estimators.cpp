#include "robots/mip/estimators.hpp"

namespace equipoise {
namespace {

/// Play in the gears, by far more than the encoders' counts (0.003 rad). A wheel without load turns as fast
/// as the back-EMF lets it.
SensorFaultsParams sensor_faults(const MipEstimatorParams& params) {
  SensorFaultsParams p;
  p.balances = {true, false, false};
  p.slowly_rad_s = 2.0 * kPi;  // as without any sensor: degraded.hpp
  p.axis_sign = params.gyro_axis_sign;
  p.evidence.encoder_sigma_rad = 0.012;
  p.evidence.encoder_count_rad = 0.003;
  p.evidence.wheel_step_rad = kTickS * params.robot.k1 / params.robot.k2;
  p.evidence.gyro_sigma_rad_s[1] = 0.1;  // tiles: a wheel climbs 0.7 mm in 0.1 s
  return p;
}

/// The gyro's scale errs by 3 % (MPU-9250) while the body turns at up to 0.7 rad/s: the tilt walks by so much
/// a tick, which the control's filter, for its margins, does not say. On two wheels an encoder that counts
/// backwards looks like one that slips.
MipEkf::Params evidence(MipEkf::Params p) {
  p.options.encoders_slip = false;
  p.filter.Q(MipEkfModel::kTheta) = std::pow(0.03 * 0.7 * kTickS, 2);
  return p;
}

constexpr double kTyresSlipS = 0.0;  // that is, they roll

}  // namespace

MipEstimators::MipEstimators(const Params& params)
    : FaultTolerant(params, sensor_faults(params), evidence(params.ekf), kTyresSlipS),
      complementary_kf_(MipInclinometerModel{}, params.complementary_kf),
      planar_kf_(MipPlanarModel(params.robot), params.planar_kf),
      ekf_published_(MipPublishedModel{}, params.ekf_published) {}

void MipEstimators::start(const Mip::Sample& z) noexcept {
  const Vec2 tilt = rest_tilt_.update(z.accel_B_m_s2);
  const double lean = tilt.x();
  const double phi = kinematics_.phi(z.wheel_angle_rad);
  heading_ = kinematics_.psi(z.wheel_angle_rad);
  gyro_previous_ = z.gyro_B_rad_s.x();
  inclination_previous_ = lean;

  complementary_kf_.reset({lean, 0.0});
  planar_kf_.reset({lean, phi, 0.0, 0.0});
  start_filter(tilt, z);
  Vec<6> x6 = Vec<6>::Zero();
  x6.head<3>() << lean, phi, heading_;
  ekf_published_.reset(x6);

  for (std::size_t i = 0; i < kCount; ++i) {
    if (i == index(Id::kTruth)) continue;
    MipEstimate& x = estimates_[i];
    const Vec2 position = x.position_W_m;
    x = MipEstimate{};
    x.theta = lean;
    x.phi = phi;
    x.psi = heading_;
    x.theta_dot = z.gyro_B_rad_s.x();
    x.psi_dot = z.gyro_B_rad_s.z();
    x.position_W_m = position;
  }
}

void MipEstimators::start_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s,
                                 const Mip::Sample& z) noexcept {
  rest_bias_.tell(gyro_bias_B_rad_s);
  start(z);
  start_filter_moving(tilt_rad, gyro_bias_B_rad_s, z);
}

void MipEstimators::from_wheels_and_gyro(Id id, const Mip::Sample& z) noexcept {
  MipEstimate& x = at(id);
  if (z.encoders_ok) {
    x.phi = kinematics_.phi(z.wheel_angle_rad);
    x.phi_dot = kinematics_.phi(z.wheel_rate_rad_s);
  }
  x.psi = heading_;
  if (z.imu_ok) {
    x.theta_dot = z.gyro_B_rad_s.x();
    x.psi_dot = z.gyro_B_rad_s.z();
  }
}

void MipEstimators::complementary(const Mip::Sample& z) noexcept {
  MipEstimate& x = at(Id::kComplementary);
  const double c = params_.complementary_weight;
  x.theta = c * x.theta + kTickS * gyro_previous_ + (1.0 - c) * inclination_previous_;  // (3.29)
  from_wheels_and_gyro(Id::kComplementary, z);
}

void MipEstimators::complementary_kf(const Mip::Sample& z) noexcept {
  const Vec<1> gyro = Vec<1>::Constant(gyro_previous_);
  complementary_kf_.predict(gyro);
  complementary_kf_.update(gyro, Vec<1>::Constant(accel_inclination(z.accel_B_m_s2)), {z.imu_ok});
  MipEstimate& x = at(Id::kComplementaryKf);
  x.theta = complementary_kf_.x()(0);
  x.normalized_innovation = complementary_kf_.normalized_innovation();
  from_wheels_and_gyro(Id::kComplementaryKf, z);
}

void MipEstimators::planar_kf(const Mip::Sample& z, const Vec2& u) noexcept {
  const Vec<1> u_x = Vec<1>::Constant(u.x());
  planar_kf_.predict(u_x);
  planar_kf_.update(u_x, {kinematics_.phi(z.wheel_angle_rad), z.gyro_B_rad_s.x(), z.accel_B_m_s2.y()},
                    {z.encoders_ok, z.imu_ok, z.imu_ok});
  from_wheels_and_gyro(Id::kPlanarKf, z);
  MipEstimate& x = at(Id::kPlanarKf);
  const Vec<4>& state = planar_kf_.x();
  x.theta = state(0);
  x.phi = state(1);
  x.theta_dot = state(2);
  x.phi_dot = state(3);
  x.normalized_innovation = planar_kf_.normalized_innovation();
}

void MipEstimators::step_ekf(const Mip::Sample& z, const Vec2& u) noexcept {
  MipEstimate& x = at(Id::kEkf);
  step_filter(z, u, body_rates(x));
  const Vec2 position = x.position_W_m;
  x = ekf_.estimate();
  x.position_W_m = position;
}

void MipEstimators::ekf_published(const Mip::Sample& z, const Vec2& u) noexcept {
  const bool e = z.encoders_ok;
  const bool i = z.imu_ok;
  ekf_published_.predict(u);
  ekf_published_.update(u,
                        {kinematics_.phi(z.wheel_angle_rad), z.gyro_B_rad_s.x(), z.accel_B_m_s2.y(),
                         kinematics_.psi(z.wheel_angle_rad)},
                        {e, i, i, e});
  MipEstimate& x = at(Id::kEkfPublished);
  const Vec<6>& state = ekf_published_.x();
  x.theta = state(MipPublishedModel::kTheta);
  x.phi = state(MipPublishedModel::kPhi);
  x.psi = state(MipPublishedModel::kPsi);
  x.theta_dot = state(MipPublishedModel::kThetaDot);
  x.phi_dot = state(MipPublishedModel::kPhiDot);
  x.psi_dot = state(MipPublishedModel::kPsiDot);
  x.normalized_innovation = ekf_published_.normalized_innovation();
}

void MipEstimators::attitude(const Mip::Sample& z) noexcept {
  MipEstimate& x = at(Id::kAttitude);
  if (z.attitude_ok) {
    x.theta = z.attitude_rad.x();
  } else if (z.imu_ok) {
    x.theta += kTickS * z.gyro_B_rad_s.x();
  }
  from_wheels_and_gyro(Id::kAttitude, z);
}

const MipEstimate& MipEstimators::update(const Mip::Sample& z, const Vec2& u, bool held) noexcept {
  if (held) {
    start(z);
    return at(params_.active);
  }
  if (z.imu_ok) heading_ += kTickS * z.gyro_B_rad_s.z();
  if (z.encoders_ok) {
    heading_ += kTickS / params_.heading_time_constant_s * (kinematics_.psi(z.wheel_angle_rad) - heading_);
  }
  if (runs(Id::kComplementary)) complementary(z);
  if (runs(Id::kComplementaryKf)) complementary_kf(z);
  if (runs(Id::kPlanarKf)) planar_kf(z, u);
  if (runs(Id::kEkf)) step_ekf(z, u);
  if (runs(Id::kEkfPublished)) ekf_published(z, u);
  if (runs(Id::kAttitude)) attitude(z);
  for (std::size_t i = 0; i < index(Id::kTruth); ++i) {
    MipEstimate& x = estimates_[i];
    if (!runs(static_cast<Id>(i))) continue;
    x.position_W_m += kTickS * rotate(x.psi, Vec2(0.0, axle_speed(params_.robot, x)));
  }
  if (z.imu_ok) {
    gyro_previous_ = z.gyro_B_rad_s.x();
    if (runs(Id::kComplementary)) inclination_previous_ = accel_inclination(z.accel_B_m_s2);
  }
  return at(params_.active);
}

}  // namespace equipoise
