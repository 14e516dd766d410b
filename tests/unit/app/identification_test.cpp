#include "app/identify/identification.hpp"

#include <gmock/gmock.h>

#include "equipoise/plant/friction_rig.hpp"

namespace equipoise::app {
namespace {

using ::testing::HasSubstr;

BenchLog to_log(const std::vector<BenchSample>& samples, LoggedBridge bridge) {
  BenchLog log;
  log.bridge = bridge;
  log.rows = samples;
  return log;
}

BenchParams bench(std::size_t motor, BridgeType bridge) {
  BenchParams p;
  p.motor = bench_motor(motor, 0, 20e3);
  p.motor.switch_resistance_ohm = 0.0;  // else it is identified as part of the resistance
  p.motor.bridge = bridge;
  return p;
}

double off(const Identified& found, const std::string& name, double truth) {
  const Estimate* e = found.find(name);
  return e == nullptr ? 1.0 : std::abs(e->value / truth - 1.0);
}

TEST(IdentifyMotor, RecoversTheBenchsMotorsWithinTwoPercent) {
  for (std::size_t motor = 0; motor < 3; ++motor) {
    const BenchParams p = bench(motor, BridgeType::kDriveBrake);
    const Identified found = identify_motor(
        to_log(run_bench(p, bench_sequence(200.0, 1)), LoggedBridge::kDriveBrake), p.motor.inertia_kg_m2);
    ASSERT_EQ(found.refused, "");
    EXPECT_LT(off(found, "resistance_ohm", p.motor.resistance_ohm), 0.02) << motor;
    EXPECT_LT(off(found, "torque_constant_N_m_A", p.motor.torque_constant_N_m_A), 0.02) << motor;
    EXPECT_LT(off(found, "coulomb_friction_N_m", p.motor.coulomb_N_m), 0.02) << motor;
    EXPECT_GT(found.r_squared, 0.99);
  }
}

TEST(IdentifyMotor, SaysThatASlowLogDoesNotDetermineTheInductance) {
  const BenchParams p = bench(0, BridgeType::kDriveBrake);
  const Identified found =
      identify_motor(to_log(run_bench(p, bench_sequence(200.0, 1)), LoggedBridge::kDriveBrake), 2e-3);
  EXPECT_FALSE(found.find("inductance_H")->determined());
}

TEST(IdentifyMotor, ALockedStepDeterminesResistanceAndInductanceAndNotTheTorqueConstant) {
  for (std::size_t motor = 0; motor < 3; ++motor) {
    const BenchParams p = bench(motor, BridgeType::kDriveBrake);
    const Identified found =
        identify_motor(to_log(run_locked_step(p, 200e3, 2000), LoggedBridge::kDriveBrake), 0.0);
    ASSERT_EQ(found.refused, "");
    EXPECT_LT(off(found, "resistance_ohm", p.motor.resistance_ohm), 0.02) << motor;
    if (motor == 1) {  // 3 us time constant, 5 us samples
      EXPECT_FALSE(found.find("inductance_H")->determined());
    } else {
      EXPECT_LT(off(found, "inductance_H", p.motor.inductance_H), 0.02) << motor;
    }
    EXPECT_FALSE(found.find("torque_constant_N_m_A")->determined());
  }
}

TEST(IdentifyMotor, RefusesACoastingLogDeclaredOrNot) {
  const BenchParams p = bench(0, BridgeType::kDriveCoast);
  const std::vector<BenchSample> log = run_bench(p, bench_sequence(200.0, 1));
  EXPECT_THAT(identify_motor(to_log(log, LoggedBridge::kDriveCoast), 0.0).refused, HasSubstr("drive/coast"));
  EXPECT_THAT(identify_motor(to_log(log, LoggedBridge::kUnknown), 0.0).refused, HasSubstr("coasts"));
  const BenchParams braking = bench(0, BridgeType::kDriveBrake);
  const std::vector<BenchSample> good = run_bench(braking, bench_sequence(200.0, 1));
  EXPECT_EQ(identify_motor(to_log(good, LoggedBridge::kUnknown), 0.0).refused, "");
}

FrictionRig rig(const FrictionRigParams& p) {
  FrictionRig r;
  r.flywheel_over_ball_radius = p.radius_ratio;
  return r;
}

TEST(IdentifyFriction, RecoversInertiaAndFrictionWithinTwoPercent) {
  FrictionRigParams p;
  p.viscous_N_m_s = 0.003;
  const Identified found = identify_friction(to_log(run_friction_rig(p), LoggedBridge::kUnknown), rig(p));
  ASSERT_EQ(found.refused, "");
  EXPECT_LT(off(found, "flywheel_inertia_kg_m2", p.flywheel_inertia_kg_m2), 0.02);
  EXPECT_LT(off(found, "coulomb_friction_N_m", p.coulomb_N_m), 0.02);
  EXPECT_LT(off(found, "viscous_friction_N_m_s", p.viscous_N_m_s), 0.02);
  EXPECT_GT(found.r_squared, 0.9);
}

/// A flywheel that moves by the formula, without noise: nothing is left of rounding by windows.
TEST(IdentifyFriction, IsExactForWhatItsFormulaSays) {
  const double ratio = 1.25, inertia = 1.5e-3, coulomb = 0.05, viscous = 0.003;
  FrictionRig r;
  r.flywheel_over_ball_radius = ratio;
  const double w = 2.0 * kPi * 0.4;
  BenchLog log;
  for (int k = 0; k < 4000; ++k) {
    const double t = 0.005 * k;
    const double between = t - 0.0025;  // a row's command held since the one before
    const double rate = 30.0 * std::sin(w * between);
    const double torque = inertia * 30.0 * w * std::cos(w * between) / ratio + std::copysign(coulomb, rate) +
                          (viscous + r.k2_ball_N_m_s) * ratio * rate;
    log.rows.push_back({t, torque / r.k1_N_m, 0.0, 12.0, 30.0 / w * (1.0 - std::cos(w * t))});
  }
  const Identified found = identify_friction(log, r);
  ASSERT_EQ(found.refused, "");
  EXPECT_LT(off(found, "flywheel_inertia_kg_m2", inertia), 2e-3);
  EXPECT_LT(off(found, "coulomb_friction_N_m", coulomb), 2e-3);
  EXPECT_LT(off(found, "viscous_friction_N_m_s", viscous), 5e-3);
  r.flywheel_over_ball_radius = NAN;
  EXPECT_THAT(identify_friction(log, r).refused, HasSubstr("--radius-ratio"));
  log.radius_ratio = ratio;  // it says so itself
  EXPECT_LT(off(identify_friction(log, r), "flywheel_inertia_kg_m2", inertia), 2e-3);
  for (BenchSample& row : log.rows) row.u = -row.u;
  EXPECT_THAT(identify_friction(log, r).refused, HasSubstr("accelerates against the command"));
}

TEST(IdentifyFriction, TellsTheDirectionsApart) {
  FrictionRigParams p;
  p.negative_scale = 1.3;
  FrictionRig r = rig(p);
  r.separate_directions = true;
  const Identified found = identify_friction(to_log(run_friction_rig(p), LoggedBridge::kUnknown), r);
  EXPECT_LT(off(found, "coulomb_friction_positive_N_m", p.coulomb_N_m), 0.02);
  EXPECT_LT(off(found, "coulomb_friction_negative_N_m", 1.3 * p.coulomb_N_m), 0.02);
}

TEST(IdentifyFriction, StribeckExcessIsFoundWhereItIs) {
  FrictionRigParams p;
  p.static_ratio = 2.0;
  FrictionRig r = rig(p);
  r.stribeck = true;
  const Identified with = identify_friction(to_log(run_friction_rig(p), LoggedBridge::kUnknown), r);
  EXPECT_GT(with.find("stribeck_excess_N_m")->value, 0.3 * p.coulomb_N_m);
  p.static_ratio = 1.0;
  const Identified without = identify_friction(to_log(run_friction_rig(p), LoggedBridge::kUnknown), r);
  EXPECT_LT(std::abs(without.find("stribeck_excess_N_m")->value), 0.2 * p.coulomb_N_m);
}

TEST(IdentifyFriction, RefusesAFlywheelThatDoesNotMove) {
  FrictionRigParams p;
  p.amplitude_u = 0.2;  // below the Coulomb friction
  const Identified found = identify_friction(to_log(run_friction_rig(p), LoggedBridge::kUnknown), rig(p));
  EXPECT_THAT(found.refused, HasSubstr("hardly moves"));
}

}  // namespace
}  // namespace equipoise::app
