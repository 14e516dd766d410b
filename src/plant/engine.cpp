#include "equipoise/plant/engine.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace equipoise {
namespace {

constexpr double kRollingStart_m_s = 0.005;  // below it rolling resistance fades

EngineMotion started(Engine& engine, const Vec3& theta_rad) {
  EngineMotion motion;
  const auto [w, x, y, z] = quaternion_of(theta_rad);
  motion.R_WB = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
  engine.start(motion.R_WB, &motion);
  return motion;
}

}  // namespace

EngineBody::EngineBody(const Calibration& calibration, const WorldParams& world, int wheels, double weight_N,
                       Engine& engine)
    : world_(world),
      weight_N_(weight_N),
      engine_(engine),
      start_noise_(world.seed, kStartNoise),
      loop_noise_(world.seed, kLoop),
      motion_(started(engine, start_noise_.gaussian_vector<3>(world.initial_tilt_rad))),  // as our worlds do
      yaw_rad_(euler_angles(motion_.R_WB).z()),
      sensors_(calibration, world, wheels, start_noise_, euler_angles(motion_.R_WB)) {}

void EngineBody::drive(const Vec3& joint_torque_N_m, const Vec<kMaxMotors>& wheel_angle_rad) {
  Felt felt;
  felt.time_s = time_s_;
  felt.omega_B_rad_s = motion_.omega_B_rad_s;
  felt.wheel_angle_rad = wheel_angle_rad;
  const Vec2 v = motion_.velocity_W_m_s.head<2>();
  const Vec2 drag = -world_.rolling_resistance * weight_N_ / std::max(v.norm(), kRollingStart_m_s) * v;
  engine_.step(joint_torque_N_m, push_force_W(world_, time_s_), drag, &motion_);
  felt.specific_force_B_m_s2 = motion_.specific_force_B_m_s2;
  if (sensors_.aged()) sensors_.feel(felt);
  const double yaw = euler_angles(motion_.R_WB).z();
  if (std::abs(yaw - yaw_rad_) > kPi) turns_rad_ += std::copysign(2.0 * kPi, yaw_rad_ - yaw);
  yaw_rad_ = yaw;
}

Vec3 EngineBody::theta_rad() const noexcept {
  return euler_angles(motion_.R_WB) + Vec3(0.0, 0.0, turns_rad_);
}

RawSample EngineBody::sense(const Vec<kMaxMotors>& wheel_angle_rad, double battery_V) {
  TrueMotion now;
  now.time_s = time_s_;
  now.theta_rad = theta_rad();
  now.omega_B_rad_s = motion_.omega_B_rad_s;
  now.specific_force_B_m_s2 =
      held_ ? Vec3(motion_.R_WB.transpose() * Vec3(0.0, 0.0, kGravity_m_s2)) : motion_.specific_force_B_m_s2;
  now.wheel_angle_rad = wheel_angle_rad;
  now.battery_V = battery_V;
  return sensors_.sense(now);
}

}  // namespace equipoise
