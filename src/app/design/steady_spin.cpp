#include "app/design/steady_spin.hpp"

#include "robots/mbbr/high_yaw.hpp"
#include "robots/mip/models.hpp"

namespace equipoise::app {

/// States: tilt z, encoder angle q, body rate w, ball rate v, each x + i y; q' = v - w, [T] (5.31).
Plant mbbr_plant(const MbbrParameters& p, double yaw_rate_rad_s, const Chain& chain) {
  enum State : int { kZ, kQ, kW, kV };
  const MbbrLinear linear = mbbr_linear(p, yaw_rate_rad_s);
  Plant plant;
  plant.A = linear.A;  // row and column of the ball angle give way to the encoders'
  plant.A.col(kQ).setZero();
  plant.A.row(kQ).setZero();
  plant.A(kQ, kV) = 1.0;
  plant.A(kQ, kW) = -1.0;
  plant.b = linear.b;
  plant.drift = std::polar(1.0, -yaw_rate_rad_s * kTickS);
  plant.actuation_delay_s = chain.actuation_delay_s;

  MbbrHighYaw::State x = MbbrHighYaw::State::Zero();
  x(MbbrHighYaw::kThetaDotZ) = yaw_rate_rad_s;
  const Vec3 u(0.0, 0.0, -(p.k2_ball + p.mu_v) / p.k1 * yaw_rate_rad_s);
  const MbbrCoefficients c = mbbr_coefficients(p);
  Vec<5> y;
  Vec<5> driven;
  Mat<5, 7> J;
  Mat<5, 7> unused;
  MbbrHighYaw::inertial_rows(c, x, u, y, J);
  MbbrHighYaw::inertial_rows(c, x, u + Vec3::Unit(0), driven, unused);
  const auto of = [&J](int column) { return Complex(J(3, column), J(4, column)); };
  const Complex z = of(MbbrHighYaw::kThetaX);
  const Complex z_dot = of(MbbrHighYaw::kThetaDotX);

  for (SensorRow& row : plant.sensors) row.C = Eigen::RowVectorXcd::Zero(4);
  plant.sensors[kGyro].C(kW) = 1.0;
  plant.sensors[kGyro].delay_s = chain.gyro_delay_s;
  plant.sensors[kEncoder].C(kQ) = 1.0;
  SensorRow& accel = plant.sensors[kAccel];
  accel.C(kZ) = z - Complex(0.0, yaw_rate_rad_s) * z_dot;  // z' = w - i theta_z' z
  accel.C(kW) = z_dot;
  accel.C(kV) = of(MbbrHighYaw::kPhiDotX);
  accel.D = Complex((driven - y)(3), (driven - y)(4));
  accel.delay_s = chain.accel_delay_s;
  plant.sensors[kAttitude].C(kZ) = 1.0;
  plant.sensors[kAttitude].delay_s = chain.attitude_delay_s;
  return plant;
}

/// States: theta, phi, theta', phi'.
Plant mip_plant(const MipParameters& p, double yaw_rate_rad_s, const Chain& chain) {
  const MipLinear linear = mip_linear(p, yaw_rate_rad_s);
  const MipCoefficients c = mip_coefficients(p, p.l_a.y(), p.l_a.z());
  Plant plant;
  plant.A = linear.A;
  plant.b = linear.b;
  plant.actuation_delay_s = chain.actuation_delay_s;
  for (SensorRow& row : plant.sensors) row.C = Eigen::RowVectorXcd::Zero(4);
  plant.sensors[kGyro].C(2) = 1.0;
  plant.sensors[kGyro].delay_s = chain.gyro_delay_s;
  plant.sensors[kGyroAcross].C(0) = yaw_rate_rad_s;  // turning, a tilted body turns about its y too
  plant.sensors[kGyroAcross].delay_s = chain.gyro_delay_s;
  plant.sensors[kEncoder].C(1) = 1.0;
  plant.sensors[kAccel].C(0) = c.accel_y_th + c.accel_y_th_dps2 * yaw_rate_rad_s * yaw_rate_rad_s;
  plant.sensors[kAccel].C(3) = c.accel_y_dph;
  plant.sensors[kAccel].D = c.accel_y_ux;
  plant.sensors[kAccel].delay_s = chain.accel_delay_s;
  plant.sensors[kAttitude].C(0) = 1.0;
  plant.sensors[kAttitude].delay_s = chain.attitude_delay_s;
  return plant;
}

}  // namespace equipoise::app
