#include "robots/mip/ekf.hpp"

#include "equipoise/estimate/midpoint.hpp"

namespace equipoise {

MipEkfModel::MipEkfModel(const MipParameters& p, const MipEkfOptions& options,
                         double disturbance_time_constant_s)
    : c_(options.know_lever_arm ? mip_coefficients(p, p.l_a.y(), p.l_a.z()) : mip_coefficients(p, 0.0, p.l)),
      yaw_to_wheel_(p.yaw_to_wheel()),
      bias_(options.estimate_gyro_bias ? 1.0 : 0.0),
      mount_(options.estimate_mount ? 1.0 : 0.0),
      lever_arm_(options.estimate_lever_arm ? 1.0 : 0.0),
      keep_(std::exp(-kTickS / disturbance_time_constant_s)) {
  const Motion zero = Motion::Zero();
  for (int k = 0; k < 2; ++k)
    B_.col(k) = ahead(zero, Vec2::Unit(k), kTickS) - ahead(zero, Vec2::Zero(), kTickS);
}

void MipEkfModel::derivative(const Motion& x, const Vec2& u, Motion& x_dot, Mat<6, 6>& A) const noexcept {
  constexpr int kColumn[4] = {kTheta, kThetaDot, kPhiDot, kPsiDot};
  const double in[4] = {x(kTheta), x(kThetaDot), x(kPhiDot), x(kPsiDot)};
  double a[3];
  double J[3][4];
  generated::mip::accelerations(c_, in, u.data(), a, J);
  x_dot << x.tail<3>(), a[0], a[1], a[2];
  A.setZero();
  A.topRightCorner<3, 3>().setIdentity();
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 4; ++k) A(kThetaDot + i, kColumn[k]) = J[i][k];
  }
}

MipEkfModel::Motion MipEkfModel::ahead(const Motion& x, const Vec2& u, double dt) const noexcept {
  Motion x_dot;
  Mat<6, 6> A;
  derivative(x, u, x_dot, A);
  derivative(x + 0.5 * dt * x_dot, u, x_dot, A);
  return x + dt * x_dot;
}

void MipEkfModel::predict(const Vec<12>& x, const Vec2& u, Vec<12>& x_next, Mat<12, 12>& F) const noexcept {
  const Vec2 felt = u + x.segment<2>(kDisturbance);
  Motion next;
  Mat<6, 6> F_motion;
  midpoint<6>(
      [this, &felt](const Motion& at, Motion& x_dot, Mat<6, 6>& A) { derivative(at, felt, x_dot, A); },
      x.head<6>(), kTickS, next, F_motion);
  x_next = x;
  x_next.head<6>() = next;
  x_next.segment<2>(kDisturbance) *= keep_;
  F.setIdentity();
  F.topLeftCorner<6, 6>() = F_motion;
  F.block<6, 2>(0, kDisturbance) = B_;
  F.block<2, 2>(kDisturbance, kDisturbance) *= keep_;
}

/// Friction and motors that do not do as told act through the torques: their noise is discretised as they
/// are.
Mat<12, 2> MipEkfModel::input_matrix() const noexcept {
  Mat<12, 2> B = Mat<12, 2>::Zero();
  B.topRows<6>() = B_;
  return B;
}

void MipEkfModel::measure(const Vec<12>& x, const Vec2& u, Vec<6>& y, Mat<6, 12>& H) const noexcept {
  const double in[4] = {x(kTheta), x(kThetaDot), x(kPhiDot), x(kPsiDot)};
  const Vec2 felt = u + x.segment<2>(kDisturbance);
  double a[1];
  double J[1][4];
  generated::mip::accelerometer(c_, in, felt.data(), a, J);
  const double turn = x(kPsiDot);
  const double arm = lever_arm_ * x(kLeverArm);
  const double dx = mount_ * x(kMountX);
  const double dy = mount_ * x(kMountY);
  const double across = x(kTheta) * turn;  // turning, the gyro's y axis sees theta psi'
  const double shortened = 1.0 - 0.5 * (dx * dx + dy * dy);
  H.setZero();

  // A sensor turned by delta sees omega - delta x omega, to second order of the large yaw rate only.
  y(kGyro) = x(kThetaDot) + bias_ * x(kGyroBias) - dy * turn;
  H(kGyro, kThetaDot) = 1.0;
  H(kGyro, kGyroBias) = bias_;
  H(kGyro, kPsiDot) = -dy;
  H(kGyro, kMountY) = -mount_ * turn;
  y(kGyro + 1) = across + dx * turn;
  H(kGyro + 1, kTheta) = turn;
  H(kGyro + 1, kPsiDot) = x(kTheta) + dx;
  H(kGyro + 1, kMountX) = mount_ * turn;
  y(kGyro + 2) = turn * shortened - dx * across + dy * x(kThetaDot);
  H(kGyro + 2, kTheta) = -dx * turn;
  H(kGyro + 2, kPsiDot) = shortened - dx * x(kTheta);
  H(kGyro + 2, kThetaDot) = dy;
  H(kGyro + 2, kMountX) = -mount_ * (across + dx * turn);
  H(kGyro + 2, kMountY) = mount_ * (x(kThetaDot) - dy * turn);

  // Left, right; (3.18).
  y(kWheel) = x(kPhi) + yaw_to_wheel_ * x(kPsi);
  y(kWheel + 1) = x(kPhi) - yaw_to_wheel_ * x(kPsi);
  H(kWheel, kPhi) = H(kWheel + 1, kPhi) = 1.0;
  H(kWheel, kPsi) = yaw_to_wheel_;
  H(kWheel + 1, kPsi) = -yaw_to_wheel_;

  // Torque as felt, gravity through the mount, the centripetal acceleration of the lever arm.
  y(kAccelY) = a[0] - kGravity_m_s2 * dx + arm * turn * turn;
  H(kAccelY, kTheta) = J[0][0];
  H(kAccelY, kThetaDot) = J[0][1];
  H(kAccelY, kPhiDot) = J[0][2];
  H(kAccelY, kPsiDot) = J[0][3] + 2.0 * arm * turn;
  H(kAccelY, kMountX) = -mount_ * kGravity_m_s2;
  H(kAccelY, kLeverArm) = lever_arm_ * turn * turn;
  H(kAccelY, kDisturbance) = c_.accel_y_ux;
}

MipEkf::MipEkf(const MipParameters& robot, const Params& params)
    : kinematics_(robot),
      filter_(Model(robot, params.options, params.disturbance_time_constant_s), params.filter),
      time_(params.sensor_age_s) {
  start(0.0, Vec3::Zero(), Vec2::Zero());
}

void MipEkf::start(double lean, const Vec3& gyro_bias_B_rad_s, const Vec2& wheel_angle_rad) noexcept {
  Vec<12> x = Vec<12>::Zero();
  x.head<3>() << lean, kinematics_.phi(wheel_angle_rad), kinematics_.psi(wheel_angle_rad);
  x(Model::kGyroBias) = gyro_bias_B_rad_s.x();
  filter_.reset(x);
  time_.reset(wheel_angle_rad);
  gyro_bias_yz_ = gyro_bias_B_rad_s.tail<2>();
}

void MipEkf::predict(const Vec2& u) noexcept {
  time_.advance(u);
  filter_.predict(time_.acted());
}

void MipEkf::update(const Mip::Sample& z) noexcept {
  Mip::Sample::WheelFlags wheel = z.wheel_ok;
  for (bool& ok : wheel) ok = ok && z.encoders_ok;
  time_.observe(z.wheel_angle_rad, wheel);
  Vec<6> y;
  y << z.gyro_B_rad_s, time_.stood(wheel_rate_rad_s()), z.accel_B_m_s2.y();
  y.segment<2>(Model::kGyro + 1) -= gyro_bias_yz_;
  const auto& axis = z.gyro_axis_ok;
  const bool imu = z.imu_ok;
  filter_.update(time_.acted(), y, {imu && axis[0], imu && axis[1], imu && axis[2], wheel[0], wheel[1], imu});
}

Vec2 MipEkf::wheel_rate_rad_s() const noexcept {
  return kinematics_.wheels(x()(Model::kPhiDot), x()(Model::kPsiDot));
}

MipEstimate MipEkf::estimate() const noexcept {
  Model::Motion m = x().head<6>();
  time_.to_now([&](const Vec2& u, double dt) {
    m = filter_.model().ahead(m, u + x().segment<2>(Model::kDisturbance), dt);
  });
  MipEstimate now;
  now.theta = m(Model::kTheta);
  now.phi = m(Model::kPhi);
  now.psi = m(Model::kPsi);
  now.theta_dot = m(Model::kThetaDot);
  now.phi_dot = m(Model::kPhiDot);
  now.psi_dot = m(Model::kPsiDot);
  now.normalized_innovation = filter_.normalized_innovation();
  return now;
}

}  // namespace equipoise
