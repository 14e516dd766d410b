#include "robots/mbbr/wheel_grip.hpp"

namespace equipoise {

Vec3 passed_on(const Vec3& sticking_N_m, const WheelLoads& loads, double grip_m) noexcept {
  constexpr int kRounds = 60;
  const auto limited = [&](const Vec3& passed) {
    const Vec3 most = grip_m * loads.under(passed).cwiseMax(0.0);
    return Vec3(sticking_N_m.cwiseMin(most).cwiseMax(-most));
  };
  const double own = grip_m * loads.per_torque_1_m.cwiseAbs().rowwise().sum().maxCoeff();
  const double damping = 1.0 / (1.0 + own);
  Vec3 passed = sticking_N_m;
  for (int round = 0; round < kRounds; ++round) {
    const Vec3 next = limited(passed);
    if (next == passed) return passed;
    passed += damping * (next - passed);
  }
  return limited(passed);
}

double grip_limit_N_m(double wheel_grip, const MbbrParameters& robot) noexcept {
  const double load = robot.m_t * kGravity_m_s2 * normal_force_over_weight(robot.alpha_deg * kPi / 180.0);
  return wheel_grip * load * robot.r_w;
}

}  // namespace equipoise
