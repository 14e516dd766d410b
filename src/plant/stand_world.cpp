#include "equipoise/plant/stand_world.hpp"

#include <Eigen/Dense>

#include "equipoise/plant/coulomb.hpp"

namespace equipoise {

StandWorld::StandWorld(const StandParams& stand, const MotorParameters& motor, const Calibration& calibration,
                       const WorldParams& world)
    : stand_(stand),
      calibration_(calibration),
      world_(world),
      motors_(motor, calibration, world),
      start_noise_(world.seed, kStartNoise),
      sensors_(calibration, world, stand.wheels, start_noise_, Vec3::Zero()) {}

void StandWorld::advance(const MotorCommand& command) {
  MotorCommand wired{};
  wired.enable = command.enable;
  for (std::size_t i = 0; i < static_cast<std::size_t>(stand_.wheels); ++i) {
    const auto wheel = static_cast<std::size_t>(stand_.wiring.wheel_of_motor[i]);
    wired.duty[wheel] = stand_.wiring.motor_sign[i] * command.duty[i];
  }
  motors_.command(wired);

  const Vec3 stiffness = stand_.body_inertia_kg_m2 * std::pow(2.0 * kPi * stand_.rocking_hz, 2);
  const Vec3 damping =
      stand_.body_inertia_kg_m2 * (2.0 * stand_.damping_ratio * 2.0 * kPi * stand_.rocking_hz);
  const double h = world_.step_s;
  const auto steps = std::lround(kTickS / h);
  for (long step = 0; step < steps; ++step) {
    const Vec<kMaxMotors> torque = motors_.torque(Eigen::Map<const Vec<kMaxMotors>>(rate_.data()));
    Vec3 on_body = -stiffness.cwiseProduct(rocking_rad_) - damping.cwiseProduct(omega_B_);
    for (std::size_t i = 0; i < static_cast<std::size_t>(stand_.wheels); ++i) {
      const double driven = torque(static_cast<Eigen::Index>(i)) - stand_.viscous_N_m_s * rate_[i];
      const double mobility = 1.0 / stand_.wheel_inertia_kg_m2;
      const double free = rate_[i] + h * mobility * driven;
      const double net = driven + coulomb_torque(free, mobility, h, stand_.coulomb_N_m);
      rate_[i] += h * mobility * net;
      angle_[i] += h * rate_[i];
      on_body -= stand_.axis_B[i] * net;  // motor and gear hold on to the body
    }
    omega_B_ += h * on_body.cwiseQuotient(stand_.body_inertia_kg_m2);
    rocking_rad_ += h * omega_B_;
  }
  time_s_ += kTickS;
}

RawSample StandWorld::sense() {
  TrueMotion m;
  m.time_s = time_s_;
  m.omega_B_rad_s = omega_B_ + hand_rate_B_;
  const Vec3 up_W = Vec3::UnitZ() + Vec3::UnitZ().cross(R_WB_ * rocking_rad_);  // rocking is small
  const Vec3 force_B = kGravity_m_s2 * (R_WB_.transpose() * up_W);
  // The chip's axes are stretched; the calibration's bias and scale are undone by the sensors.
  const Vec3 force_S = calibration_.R_BS.transpose() * force_B;
  m.specific_force_B_m_s2 = calibration_.R_BS * force_S.cwiseProduct(Vec3::Ones() + stand_.accel_scale_error);
  for (int i = 0; i < stand_.wheels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto wheel = static_cast<std::size_t>(stand_.wiring.wheel_of_encoder[k]);
    m.wheel_angle_rad(i) = stand_.wiring.encoder_sign[k] * angle_[wheel];
  }
  m.battery_V = motors_.battery_V();
  return sensors_.sense(m);
}

}  // namespace equipoise
