#include "robots/mip/ekf.hpp"

#include <cmath>

#include "equipoise/estimate/encoder_slip.hpp"
#include "equipoise/estimate/heun.hpp"
#include "equipoise/estimate/push_response.hpp"

namespace equipoise {
namespace {

// A push is what the accelerometer feels and no torque explains (30: 0.5 N at the centre of mass): the rates
// are in doubt by so much a tick. By the mean of all rows instead, what a lying gyro says would pass for a
// push (25 of 3840 runs unsafe); at 15, or with ten times the variance, lqr keeps itself shaking. Chosen on
// robots 1 to 80 (lies) and 101 to 150 (1 to 4 N for 50 ms, and without).
constexpr double kPushNis = 30.0;
constexpr double kPushTiltRateVariance = 0.005;
constexpr double kPushWheelRateVariance = 0.1;
constexpr int kSettling = 100;  // ticks after arming: the robot shakes by itself until it knows its mount
// A robot on two wheels turns about y only as it leans in a turn: a y that is five sigma off lies, or a wheel
// rolls over something. Either way it says nothing about the tilt for a while.
constexpr double kOddNis = 25.0;
constexpr int kWithoutTicks = 100;

// Started in motion: the gyro's noise on a robot that shakes; the slope of six samples, 12.5 ms old; what the
// wheels turn within the IMU's age.
constexpr double kMovingTiltRateVariance = 0.1 * 0.1;
constexpr double kMovingWheelRateVariance = 0.5 * 0.5;
constexpr double kMovingAngleVariance = 0.02 * 0.02;

/// Beyond one standard deviation an innovation corrects no more than one of just that (Huber 1965): the gyro
/// alone tells the tilt, but wheels that have left the ground are to be seen.
double slips(int /*wheel*/, double nis) noexcept { return std::sqrt(nis); }

}  // namespace

template class PackedFilter<MipEkfModel, generated::MipFilter>;

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

/// Flattened: the Jacobian is not asked for and falls away.
[[gnu::flatten]] MipEkfModel::Motion MipEkfModel::ahead(const Motion& x, const Vec2& u,
                                                        double dt) const noexcept {
  const auto slope = [this, &u](const Motion& at) {
    Motion x_dot;
    Mat<6, 6> A;
    derivative(at, u, x_dot, A);
    return x_dot;
  };
  return heun<6>(slope, x, dt);
}

void MipEkfModel::predict(const Vec<14>& x, const Vec2& u, Vec<14>& x_next, Mat<14, 14>& F) const noexcept {
  const Vec2 felt = u + x.segment<2>(kDisturbance);
  Motion next;
  Mat<6, 6> F_motion;
  heun<6>([this, &felt](const Motion& at, Motion& x_dot, Mat<6, 6>& A) { derivative(at, felt, x_dot, A); },
          x.head<6>(), kTickS, next, F_motion);
  // The counted heading acts on nothing else, so that its step is the true one, scaled.
  const double scale = 1.0 + x(kWheelScale);
  const double step = next(kPsi) - x(kPsi);
  next(kPsi) = x(kPsi) + scale * step;
  F_motion.row(kPsi) *= scale;
  F_motion(kPsi, kPsi) = 1.0;
  x_next = x;
  x_next.head<6>() = next;
  x_next.segment<2>(kDisturbance) *= keep_;
  F.setIdentity();
  F.topLeftCorner<6, 6>() = F_motion;
  F(kPsi, kWheelScale) = step;
  F.block<6, 2>(0, kDisturbance) = B_;
  F.block<2, 2>(kDisturbance, kDisturbance) *= keep_;
}

/// Friction and motors that do not do as told act through the torques: their noise is discretised as they
/// are.
Mat<14, 2> MipEkfModel::input_matrix() const noexcept {
  Mat<14, 2> B = Mat<14, 2>::Zero();
  B.topRows<6>() = B_;
  return B;
}

void MipEkfModel::measure(const Vec<14>& x, const Vec2& u, Vec<6>& y, Mat<6, 14>& H) const noexcept {
  const double in[4] = {x(kTheta), x(kThetaDot), x(kPhiDot), x(kPsiDot)};
  const Vec2 felt = u + x.segment<2>(kDisturbance);
  double a[1];
  double J[1][4];
  generated::mip::accelerometer(c_, in, felt.data(), a, J);
  const double turn = x(kPsiDot);
  const double arm = lever_arm_ * x(kLeverArm);
  const double dx = mount_ * x(kMountX);
  const double dy = mount_ * x(kMountY);
  const double dz = mount_ * x(kMountZ);
  const double across = x(kTheta) * turn;  // turning, the gyro's y axis sees theta psi'
  const double shortened = 1.0 - 0.5 * (dx * dx + dy * dy);
  H.setZero();

  // A sensor turned by delta sees omega - delta x omega, to second order of the large yaw rate only.
  y(kGyro) = x(kThetaDot) + bias_ * x(kGyroBias) - dy * turn + dz * across;
  H(kGyro, kTheta) = dz * turn;
  H(kGyro, kThetaDot) = 1.0;
  H(kGyro, kGyroBias) = bias_;
  H(kGyro, kPsiDot) = dz * x(kTheta) - dy;
  H(kGyro, kMountZ) = mount_ * across;
  H(kGyro, kMountY) = -mount_ * turn;
  y(kGyro + 1) = across + dx * turn - dz * x(kThetaDot);
  H(kGyro + 1, kTheta) = turn;
  H(kGyro + 1, kThetaDot) = -dz;
  H(kGyro + 1, kMountZ) = -mount_ * x(kThetaDot);
  H(kGyro + 1, kPsiDot) = x(kTheta) + dx;
  H(kGyro + 1, kMountX) = mount_ * turn;
  y(kGyro + 2) = turn * shortened - dx * across + dy * x(kThetaDot);
  H(kGyro + 2, kTheta) = -dx * turn;
  H(kGyro + 2, kPsiDot) = shortened - dx * x(kTheta);
  H(kGyro + 2, kThetaDot) = dy;
  H(kGyro + 2, kMountX) = -mount_ * (across + dx * turn);
  H(kGyro + 2, kMountY) = mount_ * (x(kThetaDot) - dy * turn);

  // Right, left; (3.18).
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

Mat<6, 2> MipEkfModel::turning_rows() const noexcept {
  Mat<6, 2> rows = Mat<6, 2>::Zero();
  rows.middleRows<2>(kWheel) << 1.0, yaw_to_wheel_, 1.0, -yaw_to_wheel_;
  return rows;
}

generated::MipFilter::Constants<double> MipEkfModel::constants() const noexcept {
  generated::MipFilter::Constants<double> k{};
  k.c = c_;
  k.yaw_to_wheel = yaw_to_wheel_;
  k.bias = bias_;
  k.mount = mount_;
  k.lever_arm = lever_arm_;
  k.g = kGravity_m_s2;
  k.keep = keep_;
  return k;
}

MipEkf::MipEkf(const MipParameters& robot, const Params& params)
    : kinematics_(robot),
      filter_(Model(robot, params.options, params.disturbance_time_constant_s), params.filter,
              params.precision),
      time_(params.sensor_age_s),
      encoders_slip_(params.options.encoders_slip) {
  const Model model(robot, params.options, params.disturbance_time_constant_s);
  const auto rates = [&model](double lean_rad, double u) {
    Model::Motion x_dot;
    Mat<6, 6> A;
    model.derivative(lean_rad * Model::Motion::Unit(Model::kTheta), u * Vec2::UnitX(), x_dot, A);
    return Vec2(x_dot(Model::kThetaDot), x_dot(Model::kPhiDot));
  };
  per_push_ = push_response({robot.m_b, robot.l, robot.r, 2.0 * robot.k1}, rates);
  Model::Motion x_dot;
  Mat<6, 6> A;
  model.derivative(Model::Motion::Zero(), Vec2::UnitY(), x_dot, A);  // the wheels push against each other
  per_hit_ = kTickS * x_dot(Model::kPsiDot) * robot.r / (2.0 * robot.k1);
  start(0.0, Vec3::Zero(), Vec2::Zero());
}

void MipEkf::allow_push(double sigma_N) noexcept {
  const Vec2 sigma = sigma_N * per_push_;
  filter_.widen(Model::kThetaDot, 1, sigma.x() * sigma.x());
  filter_.widen(Model::kPhiDot, 1, sigma.y() * sigma.y());
  filter_.correlate(Model::kThetaDot, Model::kPhiDot, sigma.x() * sigma.y());
}

void MipEkf::start(double lean, const Vec3& gyro_bias_B_rad_s, const Vec2& wheel_angle_rad) noexcept {
  Vec<14> x = Vec<14>::Zero();
  x.head<3>() << lean, kinematics_.phi(wheel_angle_rad), kinematics_.psi(wheel_angle_rad);
  x(Model::kGyroBias) = gyro_bias_B_rad_s.x();
  filter_.reset(x);
  time_.reset(wheel_angle_rad);
  gyro_bias_yz_ = gyro_bias_B_rad_s.tail<2>();
  heading_ = x(Model::kPsi);
  without_y_ = 0;
  pushed_ = false;
  settling_ = kSettling;
}

void MipEkf::start_moving(double lean, const Vec3& gyro_bias_B_rad_s, const Mip::Sample& z) noexcept {
  start(lean, gyro_bias_B_rad_s, z.wheel_angle_rad);
  Vec<14> x = filter_.x();
  x(Model::kThetaDot) = z.gyro_B_rad_s.x() - gyro_bias_B_rad_s.x();
  x(Model::kPhiDot) = kinematics_.phi(z.wheel_rate_rad_s);
  x(Model::kPsiDot) = z.gyro_B_rad_s.z() - gyro_bias_B_rad_s.z();
  filter_.reset(x);
  filter_.widen(Model::kPhi, 2, kMovingAngleVariance);
  filter_.widen(Model::kThetaDot, 1, kMovingTiltRateVariance);
  filter_.widen(Model::kPhiDot, 1, kMovingWheelRateVariance);
  filter_.widen(Model::kPsiDot, 1, kMovingTiltRateVariance);
}

void MipEkf::predict(const Vec2& u) noexcept {
  time_.advance(u);
  const double before = x()(Model::kPsiDot);
  settling_ = std::max(settling_ - 1, 0);
  const bool pushed = settling_ == 0 && pushed_;
  filter_.predict(time_.acted());
  if (pushed) {
    filter_.widen(Model::kThetaDot, 1, kPushTiltRateVariance);
    filter_.widen(Model::kPhiDot, 1, kPushWheelRateVariance);
  }
  heading_ += 0.5 * kTickS * (before + x()(Model::kPsiDot));
}

void MipEkf::adopt(const MipEkf& other) noexcept {
  filter_.adopt(other.filter_);
  time_ = other.time_;
  gyro_bias_yz_ = other.gyro_bias_yz_;
  heading_ = other.heading_;
  settling_ = other.settling_;
  without_y_ = other.without_y_;
  pushed_ = other.pushed_;
}

void MipEkf::miss(const Mip::Sample& z) noexcept {
  time_.observe(z.wheel_angle_rad, {});
  without_y_ = std::max(without_y_ - 1, 0);
  pushed_ = false;
  filter_.miss();
}

void MipEkf::innovate(const Mip::Sample& z) noexcept {
  Mip::Sample::WheelFlags wheel = z.wheel_ok;
  for (bool& ok : wheel) ok = ok && z.encoders_ok;
  time_.observe(z.wheel_angle_rad, wheel);
  Vec<6> y;
  y.segment<3>(Model::kGyro) = z.gyro_B_rad_s;
  y.segment<2>(Model::kGyro + 1) -= gyro_bias_yz_;
  y.segment<2>(Model::kWheel) = time_.stood([this] { return wheel_rate_rad_s(); });
  y(Model::kAccelY) = z.accel_B_m_s2.y();
  const auto& axis = z.gyro_axis_ok;
  const bool imu = z.imu_ok;
  without_y_ = std::max(without_y_ - 1, 0);
  std::array<bool, 6> use{
      imu && axis[0], imu && axis[1] && without_y_ == 0, imu && axis[2], wheel[0], wheel[1], imu};
  filter_.innovate(time_.acted(), y, use);
  const bool odd = filter_.row_nis()[Model::kGyro + 1] > kOddNis;
  pushed_ = filter_.row_nis()[Model::kAccelY] > kPushNis;
  if (odd || pushed_) {
    if (odd) without_y_ = kWithoutTicks;
    use[Model::kGyro + 1] = use[Model::kGyro + 1] && !odd;
    use[Model::kAccelY] = use[Model::kAccelY] && !pushed_;
    filter_.innovate(time_.acted(), y, use);
  }
  const auto counts = [this](const Vec2& wheels) {
    return Vec2(kinematics_.phi(wheels), kinematics_.psi(wheels));
  };
  slipped_ = encoders_slip_ && widen_by_slip<2>(filter_, Model::kWheel, Model::kPhi, slips, counts);
  if (slipped_) filter_.weigh_again(time_.acted(), y, use);
}

Vec2 MipEkf::wheel_rate_rad_s() const noexcept {
  return kinematics_.wheels(x()(Model::kPhiDot), (1.0 + x()(Model::kWheelScale)) * x()(Model::kPsiDot));
}

Vec2 MipEkf::wheel_angle_rad() const noexcept {
  return kinematics_.wheels(x()(Model::kPhi), x()(Model::kPsi)) + time_.age_s() * wheel_rate_rad_s();
}

MipEstimate MipEkf::estimate() const noexcept {
  Model::Motion m = x().head<6>();
  const Vec2 disturbance = x().segment<2>(Model::kDisturbance);
  time_.to_now([&](const Vec2& u, double dt) { filter_.ahead(u + disturbance, dt, m); });
  MipEstimate now;
  now.theta = m(Model::kTheta);
  now.phi = m(Model::kPhi);
  now.psi = heading_ + m(Model::kPsi) - x()(Model::kPsi);
  now.theta_dot = m(Model::kThetaDot);
  now.phi_dot = m(Model::kPhiDot);
  now.psi_dot = m(Model::kPsiDot);
  now.normalized_innovation = filter_.normalized_innovation();
  return now;
}

}  // namespace equipoise
