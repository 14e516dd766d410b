// What shadow runs ask of each robot's default filter: names of its rows, its model's step, the angles that
// it predicts. Included by shadow_run.hpp only.
#pragma once

#include <array>

#include "robots/mbbr/estimators.hpp"
#include "robots/mip/estimators.hpp"

namespace equipoise::app {

struct MipShadowModel {
  static constexpr std::array<const char*, 6> kRows{"gyro_x",  "gyro_y",  "gyro_z",
                                                    "wheel_1", "wheel_2", "accel_y"};
  static constexpr int kAxes = 1;  // tilt and rolling, about x and y
  using Motion = MipEkfModel::Motion;

  explicit MipShadowModel(const MipEstimatorParams& p)
      : model(p.robot, p.ekf.options, p.ekf.disturbance_time_constant_s),
        kinematics(p.robot),
        keep(std::exp(-kTickS / p.ekf.disturbance_time_constant_s)) {}
  static Motion start(const MipEstimate& x, const MipEkf&) {
    Motion m;
    m << x.theta, x.phi, x.psi, x.theta_dot, x.phi_dot, x.psi_dot;
    return m;
  }
  static Vec2 disturbance(const MipEkf& f) { return f.x().segment<2>(MipEkfModel::kDisturbance); }
  static Vec2 tilt(const Motion& m) { return {m(0), 0.0}; }
  static Vec2 rolled(const Motion& m) { return {m(1), 0.0}; }
  static Vec2 rolling_rate(const Motion& m) { return {m(4), 0.0}; }
  Vec2 wheel_rates(const Motion& m) const { return kinematics.wheels(m(4), m(5)); }
  Vec2 rolling(const Vec2& wheels) const { return {kinematics.phi(wheels), 0.0}; }

  MipEkfModel model;
  MipKinematics kinematics;
  double keep;
};

struct MbbrShadowModel {
  static constexpr std::array<const char*, 8> kRows{"gyro_x",  "gyro_y",  "gyro_z",  "wheel_1",
                                                    "wheel_2", "wheel_3", "accel_x", "accel_y"};
  static constexpr int kAxes = 2;
  using Observable = MbbrObservable;
  using Motion = Observable::State;

  explicit MbbrShadowModel(const MbbrEstimatorParams& p)
      : model(p.robot, p.ekf.disturbance_time_constant_s),
        kinematics(p.robot),
        keep(std::exp(-kTickS / p.ekf.disturbance_time_constant_s)) {}
  static Motion start(const MbbrEstimate& x, const MbbrEkf& f) {
    Motion m = f.x().head<10>();
    m.head<2>() = x.theta_xy;
    m.segment<3>(MbbrEkfModel::kThetaDotX) = x.theta_dot;
    m.tail<2>() = x.phi_dot_star;
    return m;
  }
  static Vec3 disturbance(const MbbrEkf& f) { return f.x().segment<3>(MbbrEkfModel::kDisturbance); }
  static Vec2 tilt(const Motion& m) { return m.head<2>(); }
  static Vec2 rolled(const Motion& m) { return m.segment<2>(MbbrEkfModel::kE) - m.head<2>(); }
  static Vec2 rolling_rate(const Motion& m) { return Observable::encoder_rate_B(m).head<2>(); }
  Vec3 wheel_rates(const Motion& m) const {
    return kinematics.wheels_from_ball(Observable::encoder_rate_B(m));
  }
  Vec2 rolling(const Vec3& wheels) const { return kinematics.ball_from_wheels(wheels).head<2>(); }

  MbbrEkfModel model;
  MbbrKinematics kinematics;
  double keep;
};

inline MipShadowModel shadow_model(const MipEstimatorParams& p) { return MipShadowModel(p); }
inline MbbrShadowModel shadow_model(const MbbrEstimatorParams& p) { return MbbrShadowModel(p); }

}  // namespace equipoise::app
