#include "equipoise/plant/motor_bench.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

/// Mean current in periodic steady state at a held speed.
double switched_mean_A(SwitchedMotorParams p, double speed_rad_s, double u, double supply_V) {
  SwitchedMotor motor(p);
  motor.hold_speed(speed_rad_s);
  for (int i = 0; i < 2000; ++i) motor.period(u, supply_V);
  const double before = motor.charge_C();
  motor.period(u, supply_V);
  return (motor.charge_C() - before) * p.pwm_hz;
}

TEST(SwitchedMotor, IdealDriveCoastHasTheClosedFormsMeanCurrent) {
  constexpr double kSupply_V = 8.0;
  for (const double hz : kBenchPwm_hz) {
    for (const BenchMotor& m : kBenchMotors) {
      SwitchedMotorParams p;
      p.resistance_ohm = m.resistance_ohm;
      p.inductance_H = m.inductance_H;
      p.torque_constant_N_m_A = m.torque_constant_N_m_A;
      p.pwm_hz = hz;
      const double T_r = p.resistance_ohm / (p.inductance_H * hz);
      for (const double omega_r : {-0.9, -0.3, 0.0, 0.4, 0.8}) {
        for (const double u : {-0.95, -0.4, 0.1, 0.5, 0.9}) {
          const double expected = drive_coast_mean_current(T_r, omega_r, u);
          const double mean =
              switched_mean_A(p, omega_r * kSupply_V / p.torque_constant_N_m_A, u, kSupply_V) *
              p.resistance_ohm / kSupply_V;
          EXPECT_NEAR(mean, expected, 1e-10) << m.name << " " << hz << " " << omega_r << " " << u;
        }
      }
    }
  }
}

TEST(SwitchedMotor, DriveBrakeIsLinear) {
  SwitchedMotorParams p;
  p.bridge = BridgeType::kDriveBrake;
  for (const double u : {-0.8, -0.2, 0.3, 1.0}) {
    const double speed = 20.0;
    const double expected = (u * 8.0 - p.torque_constant_N_m_A * speed) / p.resistance_ohm;  // [T] (4.3)
    EXPECT_NEAR(switched_mean_A(p, speed, u, 8.0), expected, 1e-10);
  }
}

TEST(SwitchedMotor, DiodeDropShortensTheTail) {
  SwitchedMotorParams p;
  const double ideal = switched_mean_A(p, 0.0, 0.3, 8.0);
  p.diode_drop_V = 0.8;
  const double dropped = switched_mean_A(p, 0.0, 0.3, 8.0);
  EXPECT_LT(dropped, 0.99 * ideal);
  EXPECT_GT(dropped, 0.5 * ideal);
}

TEST(SwitchedMotor, RunsUpToItsNoLoadSpeed) {
  SwitchedMotorParams p;
  SwitchedMotor motor(p);
  for (int i = 0; i < 200000; ++i) motor.period(1.0, 8.0);
  EXPECT_NEAR(motor.speed_rad_s(), 8.0 / p.torque_constant_N_m_A, 1e-3);
}

TEST(SwitchedMotor, CoulombFrictionStopsAndHolds) {
  SwitchedMotorParams p;
  p.coulomb_N_m = 0.01;
  SwitchedMotor motor(p);
  for (int i = 0; i < 20000; ++i) motor.period(0.02, 8.0);  // stall torque of 2 %: below friction
  EXPECT_EQ(motor.speed_rad_s(), 0.0);
}

TEST(BenchSequence, StaysInRangeAndRepeats) {
  const std::vector<double> u = bench_sequence(200.0, 1);
  ASSERT_EQ(u.size(), 12000U);
  for (const double each : u) EXPECT_LE(std::abs(each), 1.0);
  EXPECT_EQ(u, bench_sequence(200.0, 1));
  EXPECT_NE(u, bench_sequence(200.0, 2));
}

// [T] section 4.5.2: the drive/coast model explains the current, the linear model does not.
TEST(MotorBench, DriveCoastModelExplainsTheCurrentAndTheLinearModelDoesNot) {
  const std::vector<double> u = bench_sequence(200.0, 1);
  double coast = 0.0;
  double linear = 0.0;
  for (std::size_t motor = 0; motor < 3; ++motor) {
    for (std::size_t driver = 0; driver < 3; ++driver) {
      for (const double hz : kBenchPwm_hz) {
        BenchParams p;
        p.motor = bench_motor(motor, driver, hz);
        const std::vector<BenchSample> log = run_bench(p, u);
        coast += fit(p.motor, log, predict_current(p.motor, log, CurrentModel::kDriveCoast)).r_squared;
        linear += fit(p.motor, log, predict_current(p.motor, log, CurrentModel::kLinear)).r_squared;
      }
    }
  }
  EXPECT_GE(coast / 45.0, 0.97);
  EXPECT_LE(linear / 45.0, 0.75);
}

}  // namespace
}  // namespace equipoise
