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

inline constexpr int kSettleTicks = 1200;  // the filters' gains are steady then

/// Runs beside a twin that gets no disturbance; its answer is the difference.
template <class Controller>
class AboutSteadySpin {
 public:
  explicit AboutSteadySpin(const Controller& settled) : disturbed_(settled), steady_(settled) {}
  Complex step(const Readings& readings, Complex u_before) {
    return disturbed_.step(readings, u_before) - steady_.step({}, {});
  }

 private:
  Controller disturbed_;
  Controller steady_;
};

/// The MBBR's tick without friction, bridge and safety.
template <class Feedback>
class MbbrController {
 public:
  MbbrController(const MbbrConfig& config, const typename Feedback::Params& feedback, double yaw_rate_rad_s)
      : robot_(config.robot),
        kinematics_(config.robot),
        estimators_(config.estimators),
        reference_(config.reference),
        feedback_(feedback),
        yaw_step_(config.reference.yaw_acceleration_rad_s2() * kTickS) {
    for (int k = 0; k < 40; ++k) estimators_.update(sample({}), Vec3::Zero(), true);
    reference_.reset(estimators_.update(sample({}), Vec3::Zero(), true));
    command_.arm = true;
    command_.yaw_rate_rad_s = yaw_rate_rad_s;
    const int ramp = static_cast<int>(std::ceil(std::abs(yaw_rate_rad_s) / yaw_step_));
    for (int k = 0; k < ramp + kSettleTicks; ++k) step({}, {});
  }

  Complex step(const Readings& readings, Complex u_before) {
    yaw_rate_ += std::clamp(command_.yaw_rate_rad_s - yaw_rate_, -yaw_step_, yaw_step_);
    heading_ += kTickS * yaw_rate_;
    const double u_z = -(robot_.k2_ball + robot_.mu_v) / robot_.k1 * yaw_rate_;
    const MbbrEstimate& x_hat =
        estimators_.update(sample(readings), Vec3(u_before.real(), u_before.imag(), u_z), false);
    const Vec3 u = feedback_.update(reference_.update(command_, x_hat));
    return {u.x(), u.y()};
  }

 private:
  Mbbr::Sample sample(const Readings& readings) {
    Mbbr::Sample z;
    const auto xy = [&readings](Channel c) { return Vec2(readings[c].real(), readings[c].imag()); };
    z.imu_ok = z.encoders_ok = z.battery_ok = z.attitude_ok = true;
    z.gyro_B_rad_s << xy(kGyro), yaw_rate_;
    z.accel_B_m_s2 << yaw_rate_ * yaw_rate_ * robot_.l_a.head<2>() + xy(kAccel), -kGravity_m_s2;
    Vec3 phi_B;
    phi_B << xy(kEncoder), -heading_;
    z.wheel_angle_rad = kinematics_.wheels_from_ball(phi_B);
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad);
    z.attitude_rad << xy(kAttitude), heading_;
    return z;
  }

  MbbrParameters robot_;
  MbbrKinematics kinematics_;
  RotorSpeed<Mbbr::kWheels> rotor_speed_;
  MbbrEstimators estimators_;
  MbbrReferenceStage reference_;
  Feedback feedback_;
  double yaw_step_;
  Command command_;
  double yaw_rate_ = 0.0;
  double heading_ = 0.0;
};

/// The MIP's, likewise; real.
template <class Feedback>
class MipController {
 public:
  MipController(const MipConfig& config, const typename Feedback::Params& feedback, double yaw_rate_rad_s)
      : robot_(config.robot),
        kinematics_(config.robot),
        estimators_(config.estimators),
        reference_(config.reference),
        feedback_(feedback),
        yaw_step_(config.reference.max_yaw_acceleration_rad_s2 * kTickS) {
    for (int k = 0; k < 40; ++k) estimators_.update(sample({}), Vec2::Zero(), true);
    reference_.reset(estimators_.update(sample({}), Vec2::Zero(), true));
    command_.arm = true;
    command_.yaw_rate_rad_s = yaw_rate_rad_s;
    const int ramp = static_cast<int>(std::ceil(std::abs(yaw_rate_rad_s) / yaw_step_));
    for (int k = 0; k < ramp + kSettleTicks; ++k) step({}, {});
  }

  Complex step(const Readings& readings, Complex u_before) {
    yaw_rate_ += std::clamp(command_.yaw_rate_rad_s - yaw_rate_, -yaw_step_, yaw_step_);
    heading_ += kTickS * yaw_rate_;
    const double u_z = robot_.yaw_to_wheel() * (robot_.k2 + robot_.mu_v) / robot_.k1 * yaw_rate_;
    const MipEstimate& x_hat = estimators_.update(sample(readings), Vec2(u_before.real(), u_z), false);
    return {feedback_.update(reference_.update(command_, x_hat)).x(), 0.0};
  }

 private:
  Mip::Sample sample(const Readings& readings) {
    Mip::Sample z;
    z.imu_ok = z.encoders_ok = z.battery_ok = z.attitude_ok = true;
    z.gyro_B_rad_s << readings[kGyro].real(), readings[kGyroAcross].real(), yaw_rate_;
    z.accel_B_m_s2 << 0.0, yaw_rate_ * yaw_rate_ * robot_.l_a.y() + readings[kAccel].real(), -kGravity_m_s2;
    z.wheel_angle_rad = kinematics_.wheels(readings[kEncoder].real(), heading_);
    z.wheel_rate_rad_s = rotor_speed_.update(z.wheel_angle_rad);
    z.attitude_rad << readings[kAttitude].real(), 0.0, heading_;
    return z;
  }

  MipParameters robot_;
  MipKinematics kinematics_;
  RotorSpeed<Mip::kWheels> rotor_speed_;
  MipEstimators estimators_;
  MipReferenceStage reference_;
  Feedback feedback_;
  double yaw_step_;
  Command command_;
  double yaw_rate_ = 0.0;
  double heading_ = 0.0;
};

}  // namespace equipoise::app
