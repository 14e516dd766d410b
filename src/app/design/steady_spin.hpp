// Each robot's linear plant at a steady spin, and its production estimator, reference and feedback settled
// there, for whole_loop. In: configuration, yaw rate -> out: Plant, controller. Start-up only.
#pragma once

#include <algorithm>

#include "app/design/whole_loop.hpp"
#include "equipoise/sense/rotor_speed.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"

namespace equipoise::app {

Plant mbbr_plant(const MbbrParameters& p, double yaw_rate_rad_s, const Chain& chain);
Plant mip_plant(const MipParameters& p, double yaw_rate_rad_s, const Chain& chain);

/// The MBBR's signals there; its tick without friction, bridge and safety.
struct MbbrSpin {
  using Config = MbbrConfig;
  using Robot = Mbbr;
  using Estimators = MbbrEstimators;
  using Reference = MbbrReferenceStage;

  static double yaw_acceleration_rad_s2(const MbbrReferenceParams& p) { return p.yaw_acceleration_rad_s2(); }
  static Vec3 told(const MbbrParameters& p, Complex u, double yaw_rate) {
    return {u.real(), u.imag(), -(p.k2_ball + p.mu_v) / p.k1 * yaw_rate};
  }
  static Complex answer(const Vec3& u) { return {u.x(), u.y()}; }
  /// All but the wheels' rates.
  static Mbbr::Sample sample(const MbbrParameters& p, const MbbrKinematics& kinematics,
                             const Readings& readings, double yaw_rate, double heading) {
    const auto xy = [&readings](Channel c) { return Vec2(readings[c].real(), readings[c].imag()); };
    Mbbr::Sample z;
    z.gyro_B_rad_s << xy(kGyro), yaw_rate;
    z.accel_B_m_s2 << yaw_rate * yaw_rate * p.l_a.head<2>() + xy(kAccel), -kGravity_m_s2;
    Vec3 phi_B;
    phi_B << xy(kEncoder), -heading;
    z.wheel_angle_rad = kinematics.wheels_from_ball(phi_B);
    z.attitude_rad << xy(kAttitude), heading;
    return z;
  }
};

/// The MIP's, likewise; real.
struct MipSpin {
  using Config = MipConfig;
  using Robot = Mip;
  using Estimators = MipEstimators;
  using Reference = MipReferenceStage;

  static double yaw_acceleration_rad_s2(const MipReferenceParams& p) { return p.max_yaw_acceleration_rad_s2; }
  static Vec2 told(const MipParameters& p, Complex u, double yaw_rate) {
    return {u.real(), p.yaw_to_wheel() * (p.k2 + p.mu_v) / p.k1 * yaw_rate};
  }
  static Complex answer(const Vec2& u) { return {u.x(), 0.0}; }
  static Mip::Sample sample(const MipParameters& p, const MipKinematics& kinematics, const Readings& readings,
                            double yaw_rate, double heading) {
    Mip::Sample z;
    z.gyro_B_rad_s << readings[kGyro].real(), readings[kGyroAcross].real(), yaw_rate;
    z.accel_B_m_s2 << 0.0, yaw_rate * yaw_rate * p.l_a.y() + readings[kAccel].real(), -kGravity_m_s2;
    z.wheel_angle_rad = kinematics.wheels(readings[kEncoder].real(), heading);
    z.attitude_rad << readings[kAttitude].real(), 0.0, heading;
    return z;
  }
};

template <class Spin, class Feedback>
class SettledControllerOf : public SettledController {
 public:
  SettledControllerOf(const typename Spin::Config& config, const typename Feedback::Params& feedback,
                      double yaw_rate_rad_s)
      : robot_(config.robot),
        kinematics_(config.robot),
        estimators_(in_double(config.estimators)),
        reference_(config.reference),
        feedback_(feedback),
        yaw_step_(Spin::yaw_acceleration_rad_s2(config.reference) * kTickS) {
    for (int k = 0; k < 40; ++k) estimators_.update(sample({}), Input::Zero(), true);
    reference_.reset(estimators_.update(sample({}), Input::Zero(), true));
    command_.arm = true;
    command_.yaw_rate_rad_s = yaw_rate_rad_s;
    constexpr int kSettleTicks = 1200;  // the filters' gains are steady then
    const int ramp = static_cast<int>(std::ceil(std::abs(yaw_rate_rad_s) / yaw_step_));
    for (int k = 0; k < ramp + kSettleTicks; ++k) SettledControllerOf::step({}, {});
  }

  std::unique_ptr<SettledController> copy() const override {
    return std::make_unique<SettledControllerOf>(*this);
  }

  Complex step(const Readings& readings, Complex u_before) override {
    yaw_rate_ += std::clamp(command_.yaw_rate_rad_s - yaw_rate_, -yaw_step_, yaw_step_);
    heading_ += kTickS * yaw_rate_;
    const auto& x_hat = estimators_.update(sample(readings), Spin::told(robot_, u_before, yaw_rate_), false);
    return Spin::answer(feedback_.update(reference_.update(command_, x_hat)));
  }

 private:
  using Robot = typename Spin::Robot;
  using Input = Vec<Robot::kInputs>;
  using Estimators = typename Spin::Estimators;

  /// Single precision would drown a small impulse's answer in the last digit of what it settled at.
  static typename Estimators::Params in_double(typename Estimators::Params params) {
    params.ekf.precision = Precision::kDouble;
    return params;
  }

  typename Robot::Sample sample(const Readings& readings) {
    typename Robot::Sample z = Spin::sample(robot_, kinematics_, readings, yaw_rate_, heading_);
    z.imu_ok = z.encoders_ok = z.battery_ok = z.attitude_ok = true;
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad);
    return z;
  }

  typename Robot::Parameters robot_;
  typename Robot::Kinematics kinematics_;
  RotorSpeed<Robot::kWheels> rotor_speed_;
  Estimators estimators_;
  typename Spin::Reference reference_;
  Feedback feedback_;
  double yaw_step_;
  Command command_;
  double yaw_rate_ = 0.0;
  double heading_ = 0.0;
};

}  // namespace equipoise::app
