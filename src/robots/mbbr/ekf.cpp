#include "robots/mbbr/ekf.hpp"

#include <algorithm>

#include "equipoise/estimate/encoder_slip.hpp"
#include "equipoise/estimate/heun.hpp"
#include "equipoise/estimate/push_response.hpp"

namespace equipoise {

using Observable = MbbrObservable;

/// Beyond two standard deviations (NIS of real logs reaches 4) an innovation corrects the less, the larger it
/// is (redescending influence, Hampel 1974), or a robot whose wheels spin would follow them.
static double slips(double nis) noexcept {
  constexpr double kNoSlip = 4.0;
  constexpr double kMost = 1e4;  // single precision can take it off again
  return std::min(nis / kNoSlip * (nis / kNoSlip), kMost);
}

template class PackedFilter<MbbrEkfModel, generated::MbbrFilter>;

MbbrEkfModel::MbbrEkfModel(const MbbrParameters& p, double disturbance_time_constant_s)
    : c_(mbbr_coefficients(p)),
      wheels_from_ball_(p.r / p.r_w * MbbrKinematics(p).T_ob().transpose()),
      lever_arm_(p.l_a.head<2>()),
      keep_(std::exp(-kTickS / disturbance_time_constant_s)) {
  const Observable::State zero = Observable::State::Zero();
  for (int k = 0; k < 3; ++k)
    B_.col(k) = ahead(zero, Vec3::Unit(k), kTickS) - ahead(zero, Vec3::Zero(), kTickS);
}

Observable::State MbbrEkfModel::ahead(const Observable::State& x, const Vec3& u, double dt) const noexcept {
  return heun<10>([this, &u](const Observable::State& at) { return Observable::rate(c_, at, u); }, x, dt);
}

/// The scale is learnt where a gyro axis measures the same rate, about z; x and y only use it, for without
/// yaw they would read torques that are not as told as radii (speed at rest, p95: 2.1 cm/s in place of 0.7).
void MbbrEkfModel::predict(const Vec<18>& x, const Vec3& u, Vec<18>& x_next, Mat<18, 18>& F) const noexcept {
  const Vec3 felt = u + x.segment<3>(kDisturbance);
  Observable::State next;
  Mat<10, 10> F_observable;
  heun<10>([this, &felt](const Observable::State& at, Observable::State& x_dot,
                         Mat<10, 10>& A) { Observable::derivative(c_, at, felt, x_dot, A); },
           x.head<10>(), kTickS, next, F_observable);
  // The sums act on nothing else, so that their step is the true one, scaled.
  const double scale = 1.0 + x(kWheelScale);
  const Vec3 step = next.segment<3>(kE) - x.segment<3>(kE);
  next.segment<3>(kE) += x(kWheelScale) * step;
  F_observable.middleRows<3>(kE) *= scale;
  F_observable.block<3, 3>(kE, kE).setIdentity();
  // A torque that is constant in the world frame turns backwards in the yaw frame.
  const Turn turn = Turn::small(kTickS * x(kThetaDotZ));
  const double c = keep_ * turn.cosine();
  const double s = keep_ * turn.sine();
  const Vec3 d = x.segment<3>(kDisturbance);
  x_next = x;
  x_next.head<10>() = next;
  x_next.segment<3>(kDisturbance) << c * d.x() + s * d.y(), c * d.y() - s * d.x(), keep_ * d.z();
  F.setIdentity();
  F.topLeftCorner<10, 10>() = F_observable;
  F(kE + 2, kWheelScale) = step.z();  // z alone: above
  F.block<10, 3>(0, kDisturbance) = B_;
  F.block<3, 3>(kDisturbance, kDisturbance) << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, keep_;
}

/// Motors and friction that do not do as told act through the torques: their noise is discretised as they
/// are.
Mat<18, 3> MbbrEkfModel::input_matrix() const noexcept {
  Mat<18, 3> B = Mat<18, 3>::Zero();
  B.topRows<10>() = B_;
  return B;
}

void MbbrEkfModel::measure(const Vec<18>& x, const Vec3& u, Vec<8>& y, Mat<8, 18>& H) const noexcept {
  Vec<5> h;
  Mat<5, 7> J;
  MbbrHighYaw::inertial_rows(c_, Observable::dynamic(x.head<10>()), u + x.segment<3>(kDisturbance), h, J);
  H.setZero();
  H.block<3, 2>(kGyro, 0) = J.topLeftCorner<3, 2>();
  H.block<3, 5>(kGyro, kThetaDotX) = J.topRightCorner<3, 5>();
  H.block<2, 2>(kAccel, 0) = J.bottomLeftCorner<2, 2>();
  H.block<2, 5>(kAccel, kThetaDotX) = J.bottomRightCorner<2, 5>();

  // A sensor turned by delta sees omega - delta x omega, to first order in what is small; the large yaw rate
  // needs the second order, too: at 0.04 rad and 1 Hz the heading drifts by 0.3 rad a minute without it.
  const Vec3 rate = h.head<3>();
  const double turn = x(kThetaDotZ);
  const double dx = x(kMountX);
  const double dy = x(kMountY);
  const double shortened = 1.0 - 0.5 * (dx * dx + dy * dy);
  y.segment<3>(kGyro) << rate.x() + x(kBiasX) - dy * rate.z(), rate.y() + x(kBiasY) + dx * rate.z(),
      rate.z() * shortened - dx * rate.y() + dy * rate.x();
  H(kGyro, kBiasX) = 1.0;
  H(kGyro, kMountY) = -rate.z();
  H(kGyro, kThetaDotZ) -= dy;
  H(kGyro + 1, kBiasY) = 1.0;
  H(kGyro + 1, kMountX) = rate.z();
  H(kGyro + 1, kThetaDotZ) += dx;
  H(kGyro + 2, kThetaDotZ) *= shortened;
  H(kGyro + 2, kMountX) = -rate.y() - dx * rate.z();
  H(kGyro + 2, kMountY) = rate.x() - dy * rate.z();
  H(kGyro + 2, kThetaX) -= dx * turn;
  H(kGyro + 2, kThetaY) -= dy * turn;
  H(kGyro + 2, kThetaDotY) -= dx;
  H(kGyro + 2, kThetaDotX) += dy;

  // Torque as felt, gravity through the mount, the centripetal acceleration of an IMU beside the axis.
  y.segment<2>(kAccel) = h.tail<2>() + kGravity_m_s2 * Vec2(dy, -dx) + turn * turn * lever_arm_;
  H(kAccel, kDisturbance + 1) = c_.accel_x_uy;
  H(kAccel + 1, kDisturbance) = c_.accel_y_ux;
  H(kAccel, kMountY) = kGravity_m_s2;
  H(kAccel + 1, kMountX) = -kGravity_m_s2;
  H.block<2, 1>(kAccel, kThetaDotZ) += 2.0 * turn * lever_arm_;

  const double scale = 1.0 + x(kWheelScale);
  const Vec3 phi_B(x(kE) - scale * x(kThetaX), x(kE + 1) - scale * x(kThetaY), x(kE + 2));
  y.segment<3>(kWheel) = wheels_from_ball_ * phi_B;
  H.block<3, 3>(kWheel, kE) = wheels_from_ball_;
  H.block<3, 2>(kWheel, kThetaX) = -scale * wheels_from_ball_.leftCols<2>();
}

Mat<8, 3> MbbrEkfModel::turning_rows() const noexcept {
  Mat<8, 3> rows = Mat<8, 3>::Zero();
  rows.middleRows<3>(kWheel) = wheels_from_ball_;
  return rows;
}

generated::MbbrFilter::Constants<double> MbbrEkfModel::constants() const noexcept {
  generated::MbbrFilter::Constants<double> k{};
  k.c = c_;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(k.wheels) = wheels_from_ball_;
  Eigen::Map<Vec2>(k.lever_arm) = lever_arm_;
  k.g = kGravity_m_s2;
  k.keep = keep_;
  return k;
}

MbbrEkf::MbbrEkf(const MbbrParameters& robot, const Params& params)
    : params_(params),
      kinematics_(robot),
      mass_kg_(robot.m_t),
      largest_scale_(3.0 * std::sqrt(params.filter.initial_variance(Model::kWheelScale))),
      filter_(Model(robot, params.disturbance_time_constant_s), params.filter, params.precision),
      time_(params.sensor_age_s) {
  const auto rates = [c = mbbr_coefficients(robot)](double lean_rad, double u) {
    const Observable::State x_dot =
        Observable::rate(c, lean_rad * Observable::State::Unit(Model::kThetaX), u * Vec3::UnitX());
    return Vec2(x_dot(Model::kThetaDotX), x_dot(Model::kPhiDotX));
  };
  per_push_ = push_response({robot.m_t, robot.l, robot.r, robot.k1}, rates);
  start(Vec2::Zero(), Vec3::Zero(), Vec3::Zero());
}

/// A wheel that slips makes the motors' torque less than told: the accelerometer feels that, too, but it is
/// no push, and rates that it widens would follow the wheel.
double MbbrEkf::felt_push_N() const noexcept {
  const auto& nis = filter_.row_nis();
  if (slipped_ || !(0.5 * (nis[Model::kAccel] + nis[Model::kAccel + 1]) > params_.push_nis)) return 0.0;
  const auto& felt = filter_.row_innovation();
  return mass_kg_ * std::hypot(felt[Model::kAccel], felt[Model::kAccel + 1]);
}

void MbbrEkf::allow_push(double sigma_N) noexcept {
  const Vec2 sigma = sigma_N * per_push_;
  for (int i = 0; i < 2; ++i) {
    filter_.widen(Model::kThetaDotX + i, 1, sigma.x() * sigma.x());
    filter_.widen(Model::kPhiDotX + i, 1, sigma.y() * sigma.y());
    filter_.correlate(Model::kThetaDotX + i, Model::kPhiDotX + i, sigma.x() * sigma.y());
  }
}

void MbbrEkf::start(const Vec2& tilt, const Vec3& gyro_bias_B_rad_s, const Vec3& wheel_angle_rad) noexcept {
  Vec<18> x = Vec<18>::Zero();
  x.head<2>() = tilt;
  x.segment<3>(Model::kE) = kinematics_.ball_from_wheels(wheel_angle_rad) + Vec3(tilt.x(), tilt.y(), 0.0);
  x.segment<2>(Model::kBiasX) = gyro_bias_B_rad_s.head<2>();
  filter_.reset(x);
  time_.reset(wheel_angle_rad);
  gyro_bias_z_ = gyro_bias_B_rad_s.z();
  heading_ = 0.0;
  direction_ = Turn(0.0);
  phi_.setZero();
}

void MbbrEkf::start_moving(const Vec2& tilt, const Vec3& gyro_bias_B_rad_s, const Mbbr::Sample& z) noexcept {
  start(tilt, gyro_bias_B_rad_s, z.wheel_angle_rad);
  Vec<18> x = filter_.x();
  x.segment<3>(Model::kThetaDotX) = euler_rates(tilt, Vec3(z.gyro_B_rad_s - gyro_bias_B_rad_s));
  x.segment<2>(Model::kPhiDotX) =
      kinematics_.ball_from_wheels(z.wheel_rate_rad_s).head<2>() + x.segment<2>(Model::kThetaDotX);
  filter_.reset(x);
  // The gyro's noise on a robot that shakes; the slope of six samples, 12.5 ms old; the IMU's age.
  filter_.widen(Model::kThetaDotX, 3, 0.1 * 0.1);
  filter_.widen(Model::kPhiDotX, 2, 0.5 * 0.5);
  filter_.widen(Model::kE, 3, 0.02 * 0.02);
}

void MbbrEkf::predict(const Vec3& u) noexcept {
  time_.advance(u);
  // [T] (6.3)-(6.4), over the tick that the filter leaves behind, by the mean of the rates at its ends.
  const Vec2 before = x().segment<2>(Model::kPhiDotX);
  const double rate_before = x()(Model::kThetaDotZ);
  const double push_N = felt_push_N();
  filter_.predict(time_.acted());
  if (push_N > 0.0) allow_push(push_N);
  const double turn = 0.5 * kTickS * (rate_before + x()(Model::kThetaDotZ));
  const Vec2 mean = 0.5 * (before + x().segment<2>(Model::kPhiDotX));
  const Turn half = Turn::small(0.5 * turn);
  const Turn middle = direction_ * half;
  phi_ += kTickS * middle(mean);
  heading_ += turn;
  direction_ = std::abs(turn) < 0.2 ? middle * half : Turn(heading_);  // beyond, half is not exact
}

void MbbrEkf::adopt(const MbbrEkf& other) noexcept {
  filter_.adopt(other.filter_);
  time_ = other.time_;
  gyro_bias_z_ = other.gyro_bias_z_;
  heading_ = other.heading_;
  direction_ = other.direction_;
  phi_ = other.phi_;
}

void MbbrEkf::miss(const Mbbr::Sample& z) noexcept {
  time_.observe(z.wheel_angle_rad, {});
  filter_.miss();
}

void MbbrEkf::innovate(const Mbbr::Sample& z) noexcept {
  Mbbr::Sample::WheelFlags wheel = z.wheel_ok;
  for (bool& ok : wheel) ok = ok && z.encoders_ok;
  time_.observe(z.wheel_angle_rad, wheel);
  Vec<8> y;
  y.segment<3>(Model::kGyro) = z.gyro_B_rad_s;
  y(Model::kGyro + 2) -= gyro_bias_z_;
  y.segment<3>(Model::kWheel) = time_.stood([this] { return wheel_rate_rad_s(); });
  y.segment<2>(Model::kAccel) = z.accel_B_m_s2.head<2>();
  const auto& axis = z.gyro_axis_ok;
  const bool imu = z.imu_ok;
  const std::array<bool, 8> use{
      imu && axis[0], imu && axis[1], imu && axis[2], wheel[0], wheel[1], wheel[2], imu, imu};
  filter_.innovate(time_.acted(), y, use);
  const auto counts = [this](const Vec3& wheels) { return kinematics_.ball_from_wheels(wheels); };
  // What stands still does not slip: it is stuck, or its encoder is dead.
  const auto widens = [this](int i, double nis) { return time_.stands(i) ? 1.0 : slips(nis); };
  slipped_ = widen_by_slip<3>(filter_, Model::kWheel, Model::kE, widens, counts);
  if (slipped_) filter_.weigh_again(time_.acted(), y, use);
}

Vec3 MbbrEkf::wheel_rate_rad_s() const noexcept {
  const double scale = 1.0 + x()(Model::kWheelScale);
  return scale * kinematics_.wheels_from_ball(Observable::encoder_rate_B(x().head<10>()));
}

Vec3 MbbrEkf::wheel_angle_rad() const noexcept {
  const double scale = 1.0 + x()(Model::kWheelScale);
  const Vec3 phi_B(x()(Model::kE) - scale * x()(Model::kThetaX),
                   x()(Model::kE + 1) - scale * x()(Model::kThetaY), x()(Model::kE + 2));
  return kinematics_.wheels_from_ball(phi_B) + time_.age_s() * wheel_rate_rad_s();
}

MbbrEstimate MbbrEkf::estimate() const noexcept {
  MbbrEstimate now;
  now.theta_z = heading_;
  now.phi = phi_;
  Observable::State s = x().head<10>();
  const Vec3 disturbance = x().segment<3>(Model::kDisturbance);
  time_.to_now([&](const Vec3& u, double dt) {
    const Observable::State then = s;
    filter_.ahead(u + disturbance, dt, s);
    const double turn = 0.5 * dt * (then(Model::kThetaDotZ) + s(Model::kThetaDotZ));
    const Turn middle = direction_ * Turn::small(now.theta_z - heading_ + 0.5 * turn);
    now.phi += dt * middle(Vec2(0.5 * (then.tail<2>() + s.tail<2>())));
    now.theta_z += turn;
  });
  now.theta_xy = s.head<2>();
  now.theta_dot = s.segment<3>(Model::kThetaDotX);
  now.phi_dot_star = s.tail<2>();
  now.omega_B = MbbrHighYaw::body_rates(now.theta_xy, now.theta_dot);
  now.normalized_innovation = filter_.normalized_innovation();
  return now;
}

}  // namespace equipoise
