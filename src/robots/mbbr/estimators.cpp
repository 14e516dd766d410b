#include "robots/mbbr/estimators.hpp"

#include <limits>

namespace equipoise {
namespace {

template <class Filter, std::size_t M>
void step(Filter& filter, const Vec3& u, const Vec<static_cast<int>(M)>& y,
          const std::array<bool, M>& use) noexcept {
  filter.predict(u);
  filter.update(u, y, use);
}

/// Encoders of 720 counts (0.0087 rad), and as much again of play between motor and wheel. A wheel without
/// load turns as fast as the back-EMF lets it.
SensorFaultsParams sensor_faults(const MbbrEstimatorParams& params) {
  const MbbrParameters& robot = params.robot;
  const double no_load_rad_s = robot.k1 / robot.k2_ball * robot.r / robot.r_w;
  SensorFaultsParams p;
  p.balances = {true, true, false};
  p.axis_sign = params.gyro_axis_sign;
  p.bias_drifts = true;
  p.evidence.encoder_sigma_rad = 0.012;
  p.evidence.encoder_count_rad = 2.0 * kPi / 720.0;
  p.evidence.wheel_step_rad = kTickS * no_load_rad_s;
  p.evidence.slips = 0.5;  // as many as of the faulty encoders turn: no verdict comes from turning
  return p;
}

/// A push is one of the detector's hypotheses: no filter of it assumes one by itself.
MbbrEkf::Params evidence(MbbrEkf::Params p) noexcept {
  p.push_nis = std::numeric_limits<double>::infinity();
  return p;
}

double wrapped(double angle) noexcept { return std::remainder(angle, 2.0 * kPi); }

}  // namespace

MbbrEstimators::MbbrEstimators(const Params& params)
    : FaultTolerant(params, sensor_faults(params), evidence(params.ekf),
                    params.ekf.disturbance_time_constant_s),
      ekf13_published_(MbbrPublishedModel{}, params.ekf13_published),
      ekf13_(MbbrModel13(params.robot), params.ekf13),
      kf_(params.kf_published ? MbbrLinearModel::published()
                              : MbbrLinearModel(params.robot, params.kf_yaw_transport),
          params.kf) {}

void MbbrEstimators::start(const Mbbr::Sample& z) noexcept {
  const Vec2 tilt = rest_tilt_.update(z.accel_B_m_s2);
  const Vec3 phi_B = kinematics_.ball_from_wheels(z.wheel_angle_rad);

  start_filter(tilt, z);

  Vec<13> x13 = Vec<13>::Zero();
  x13.head<2>() = tilt;
  x13.segment<3>(MbbrPublishedModel::kSlipX) = phi_B + Vec3(tilt.x(), tilt.y(), 0.0);
  ekf13_.reset(x13);
  ekf13_published_.reset(x13);

  Vec<8> x8 = Vec<8>::Zero();
  x8.head<2>() = tilt;
  x8.segment<2>(2) = phi_B.head<2>() + tilt;
  kf_.reset(x8);

  for (std::size_t i = 0; i < kCount; ++i) {
    if (i == index(Id::kTruth)) continue;
    estimates_[i] = MbbrEstimate{};
    estimates_[i].theta_xy = tilt;
    estimates_[i].omega_B = z.gyro_B_rad_s;
  }
  attitude_heading_ = z.attitude_rad.z();
}

void MbbrEstimators::start_moving(const Vec2& tilt_rad, const Vec3& gyro_bias_B_rad_s,
                                  const Mbbr::Sample& z) noexcept {
  rest_bias_.tell(gyro_bias_B_rad_s);
  start(z);
  start_filter_moving(tilt_rad, gyro_bias_B_rad_s, z);
}

/// Heading and inertial ball angles, [T] (6.3)-(6.4).
void MbbrEstimators::integrate(Id id, double heading_rate) noexcept {
  MbbrEstimate& x = at(id);
  x.phi += kTickS * rotate(x.theta_z, x.phi_dot_star);
  x.theta_z += kTickS * heading_rate;
}

void MbbrEstimators::step_ekf(const Mbbr::Sample& z, const Vec3& u) noexcept {
  MbbrEstimate& x = at(Id::kEkf);
  step_filter(z, u, x.omega_B);
  x = ekf_.estimate();
}

const MbbrEstimate& MbbrEstimators::update(const Mbbr::Sample& z, const Vec3& u, bool held) noexcept {
  if (held) {
    start(z);
    return at(params_.active);
  }
  if (runs(Id::kEkf)) step_ekf(z, u);
  if (runs_published()) published(z, u);
  return at(params_.active);
}

/// The filters of [T] and the linear one.
void MbbrEstimators::published(const Mbbr::Sample& z, const Vec3& u) noexcept {
  const Vec3 phi_B = kinematics_.ball_from_wheels(z.wheel_angle_rad);
  Vec<8> y;
  y << z.gyro_B_rad_s, phi_B, z.accel_B_m_s2.head<2>();
  const bool i = z.imu_ok;
  const bool e = z.encoders_ok;
  const std::array<bool, 8> use{i, i, i, e, e, e, i, i};

  const auto from_13 = [this](Id id, const Vec<13>& x, double nis) {
    MbbrEstimate& out = at(id);
    integrate(id, 0.0);
    out.theta_xy = x.head<2>();
    out.theta_z = x(MbbrPublishedModel::kThetaZ);
    out.theta_dot = x.segment<3>(MbbrPublishedModel::kThetaDotX);
    out.phi_dot_star = x.segment<2>(MbbrPublishedModel::kPhiDotX);
    out.omega_B = body_rates(out.theta_xy, out.theta_dot);
    out.normalized_innovation = nis;
  };
  if (runs(Id::kEkf13Published)) {
    step(ekf13_published_, u, y, use);
    from_13(Id::kEkf13Published, ekf13_published_.x(), ekf13_published_.normalized_innovation());
  }
  if (runs(Id::kEkf13)) {
    step(ekf13_, u, y, use);
    from_13(Id::kEkf13, ekf13_.x(), ekf13_.normalized_innovation());
  }

  if (runs(
          Id::kKfAttitude)) {  // [T] section 6.4.6: attitude from its source, the rest from the linear filter
    Vec<6> y6;
    y6 << z.gyro_B_rad_s.head<2>(), phi_B.head<2>(), z.accel_B_m_s2.head<2>();
    step(kf_, Vec3(u.x(), u.y(), z.gyro_B_rad_s.z()), y6, std::array<bool, 6>{i, i, e, e, i, i});
    const Vec<8>& x = kf_.x();
    MbbrEstimate& out = at(Id::kKfAttitude);
    if (z.attitude_ok) {
      integrate(Id::kKfAttitude, wrapped(z.attitude_rad.z() - attitude_heading_) / kTickS);
      out.theta_xy = z.attitude_rad.head<2>();
      attitude_heading_ = z.attitude_rad.z();
    } else {  // hold the tilt, carry the heading with the gyro
      integrate(Id::kKfAttitude, z.gyro_B_rad_s.z());
      attitude_heading_ += kTickS * z.gyro_B_rad_s.z();
    }
    out.omega_B << x.segment<2>(4),
        z.gyro_B_rad_s.z();  // the filter's theta' is a smoothed gyro: a body rate
    out.theta_dot = euler_rates(out.theta_xy, out.omega_B);
    out.phi_dot_star = x.tail<2>();
    out.normalized_innovation = kf_.normalized_innovation();
  }
}

}  // namespace equipoise
