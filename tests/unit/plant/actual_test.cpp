// `actual` scales the plant and nothing else: known ratios of what the robot then does.
#include <gtest/gtest.h>

#include "equipoise/plant/integrator.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/world.hpp"
#include "unit/plant/level_world.hpp"

namespace equipoise {
namespace {

MotorParameters linear_motor() {
  MotorParameters m;
  m.bridge = BridgeType::kDriveBrake;
  return m;
}

/// Yaw rate after `ticks` of equal duties.
double spin_rad_s(const ActualScales& actual, int ticks) {
  MbbrWorldParams w = level_world_without_friction();
  w.common.actual = actual;
  MbbrWorld world(MbbrParameters(), linear_motor(), Calibration(), w);
  MotorCommand command{};
  command.enable = true;
  for (int i = 0; i < 3; ++i) command.duty[i] = 0.5;
  for (int i = 0; i < ticks; ++i) world.advance(command);
  return std::abs(world.truth().omega_B.z());
}

TEST(Actual, ScalesDimensionsMassesAndInertias) {
  ActualScales a;
  a.body_mass = 1.1;
  a.com_height = 0.9;
  a.body_inertia = 1.2;
  a.ball_mass = 0.8;
  a.ball_radius = 1.05;
  a.wheel_radius = 0.95;
  const MbbrParameters nominal;
  const MbbrParameters built = as_built(nominal, a);
  EXPECT_DOUBLE_EQ(built.m_t, 1.1 * nominal.m_t);
  EXPECT_DOUBLE_EQ(built.l, 0.9 * nominal.l);
  EXPECT_DOUBLE_EQ(built.I_t3, 1.2 * nominal.I_t3);
  EXPECT_DOUBLE_EQ(built.m_b, 0.8 * nominal.m_b);
  EXPECT_NEAR(built.I_b / nominal.I_b, 0.8 * 1.05 * 1.05, 1e-12);  // m r^2
  EXPECT_NEAR(built.I_w / nominal.I_w, std::pow(1.05 / 0.95, 2), 1e-12);
  EXPECT_EQ(built.l_a, nominal.l_a);

  const MipParameters mip = as_built(MipParameters(), a);
  EXPECT_DOUBLE_EQ(mip.r, 0.95 * MipParameters().r);
  EXPECT_DOUBLE_EQ(mip.I_b2, 1.2 * MipParameters().I_b2);
}

TEST(Actual, TorqueScalesTheAccelerationAndBackEmfTheTopSpeed) {
  ActualScales strong;
  strong.torque = 1.2;
  EXPECT_NEAR(spin_rad_s(strong, 1) / spin_rad_s({}, 1), 1.2, 0.02);
  ActualScales braked;
  braked.back_emf = 1.25;
  EXPECT_NEAR(spin_rad_s({}, 600) / spin_rad_s(braked, 600), 1.25, 0.01);  // run up: no load
  EXPECT_NEAR(spin_rad_s(braked, 1) / spin_rad_s({}, 1), 1.0, 0.02);       // stalled: no back-EMF
  ActualScales heavy;
  heavy.body_inertia = 2.0;
  const MbbrParameters p;
  const double damping = std::pow(p.r / p.r_w, 2) * linear_motor().k2();
  const auto run_up = [&](double inertia) { return 1.0 - std::exp(-damping * kTickS / inertia); };
  EXPECT_NEAR(spin_rad_s({}, 1) / spin_rad_s(heavy, 1), run_up(p.I_t3 + p.I_w) / run_up(2.0 * p.I_t3 + p.I_w),
              1e-6);
}

TEST(Actual, TheFirmwareKeepsItsNumbers) {
  const std::string path = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
  const MbbrConfig plain = load_mbbr(path, {}).config;
  const MbbrConfig heavy = load_mbbr(path, {"world.nominal.actual.body_mass_scale=1.2",
                                            "world.full.actual.ball_radius_scale=0.95"})
                               .config;
  EXPECT_EQ(heavy.world[static_cast<std::size_t>(Fidelity::kNominal)].common.actual.body_mass, 1.2);
  EXPECT_EQ(heavy.world[static_cast<std::size_t>(Fidelity::kFull)].common.actual.ball_radius, 0.95);
  EXPECT_EQ(heavy.world[static_cast<std::size_t>(Fidelity::kIdeal)].common.actual.body_mass, 1.0);
  EXPECT_EQ(heavy.robot.m_t, plain.robot.m_t);
  EXPECT_EQ(heavy.robot.r, plain.robot.r);
}

TEST(Integrator, IsOfFourthOrder) {
  const auto error = [](double h) {
    Vec2 s(1.0, 0.0);
    const auto turning = [](const Vec2& x) { return Vec2(x.y(), -x.x()); };
    const int steps = static_cast<int>(std::lround(1.0 / h));
    for (int i = 0; i < steps; ++i) s = rk4_step(s, turning(s), h, turning);
    return (s - Vec2(std::cos(1.0), -std::sin(1.0))).norm();
  };
  EXPECT_NEAR(error(0.1) / error(0.05), 16.0, 1.0);
}

TEST(MbbrDynamics, AFurtherTorqueAddsItsResponse) {
  const MbbrDynamics dynamics{MbbrParameters{}};
  const MbbrMotion m(Vec2(0.1, -0.2), Vec3(0.3, -0.4, 6.0), Vec2(3.0, -2.0));
  const Vec3 tau(0.02, -0.05, 0.03);
  const Vec3 more(-0.04, 0.01, 0.02);
  const MbbrMass mass = dynamics.mass(m);
  const MbbrAccelerations whole = dynamics.accelerations(m, tau + more);
  const MbbrAccelerations part = dynamics.accelerations(m, tau);
  const MbbrAccelerations added = dynamics.response(m, mass, more);
  EXPECT_LT((part.omega_dot_B + added.omega_dot_B - whole.omega_dot_B).norm(), 1e-10);
  EXPECT_LT((part.phi_ddot_inertial + added.phi_ddot_inertial - whole.phi_ddot_inertial).norm(), 1e-10);
}

}  // namespace
}  // namespace equipoise
