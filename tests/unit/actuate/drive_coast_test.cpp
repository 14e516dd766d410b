#include "equipoise/actuate/drive_coast.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "equipoise/actuate/bridge.hpp"
#include "support/oracle.hpp"

namespace equipoise {
namespace {

TEST(DriveCoast, MatchesTheIntegratedSwitchingCircuit) {
  const auto rows = test::oracle_rows("drive_coast");
  ASSERT_EQ(rows.size(), 400U);
  for (const auto& row : rows) {
    const double i = drive_coast_mean_current(row["T_r"], row["omega_r"], row["u"]);
    EXPECT_NEAR(i, row["i_over_is"].get<double>(), 1e-10);
    const DriveCoastSolution back = drive_coast_invert(row["T_r"], row["omega_r"], row["i_over_is"]);
    EXPECT_NEAR(drive_coast_mean_current(row["T_r"], row["omega_r"], back.u), row["i_over_is"].get<double>(),
                1e-9);
  }
}

/// Integration of (4.7)-(4.8) in periodic steady state, with the zero crossing found exactly.
double switched_mean(double T_r, double omega_r, double v) {
  const double high = 1.0 - omega_r;
  const double low = -(1.0 + omega_r);
  double i0 = 0.0;
  double mean = 0.0;
  for (int period = 0; period < 1000; ++period) {
    const double i1 = high + (i0 - high) * std::exp(-v * T_r);
    const double charge_high = high * v * T_r + (i0 - high) * -std::expm1(-v * T_r);
    const double off = (1.0 - v) * T_r;
    double drained = i1 > 0.0 ? std::log((i1 - low) / -low) : 0.0;
    if (low == 0.0) drained = off;
    const double t = std::min(drained, off);
    const double charge_low = low * t + (i1 - low) * -std::expm1(-t);
    i0 = t < off ? 0.0 : low + (i1 - low) * std::exp(-t);
    mean = (charge_high + charge_low) / T_r;
  }
  return mean;
}

TEST(DriveCoast, ForwardModelAgreesWithSwitchingOverTheWholeDomain) {
  for (const double T_r : {0.05, 0.289, 1.0, 5.0, 40.0}) {
    for (const double w : {-0.99, -0.5, 0.0, 0.5, 0.99}) {
      for (const double v : {0.01, 0.1, 0.4, 0.7, 0.95, 1.0}) {
        EXPECT_NEAR(drive_coast_mean_current(T_r, w, v), switched_mean(T_r, w, v), 1e-9)
            << "T_r " << T_r << " omega_r " << w << " v " << v;
      }
    }
  }
}

TEST(DriveCoast, IsOddInSpeedAndCommandTogether) {
  for (const double w : {-0.7, 0.0, 0.3}) {
    for (const double u : {0.05, 0.5, 1.0}) {
      EXPECT_DOUBLE_EQ(drive_coast_mean_current(0.289, w, u), -drive_coast_mean_current(0.289, -w, -u));
    }
  }
}

TEST(DriveCoast, RoundTripsThroughForwardModelBothSignsAndAllEdges) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int most = 0;
  for (int k = 0; k < 300000; ++k) {
    const double T_r = std::pow(10.0, -12.0 + 15.0 * unit(random));
    const double pick = unit(random);
    const double edge = std::pow(10.0, -9.0 + 8.0 * unit(random));
    const double w = pick < 0.5 ? 2.0 * unit(random) - 1.0 : (pick < 0.75 ? 1.0 - edge : edge - 1.0);
    const double v = unit(random) < 0.5 ? unit(random) : std::pow(10.0, -5.0 + 5.0 * unit(random));
    const double u = unit(random) < 0.5 ? v : -v;
    const double target = drive_coast_mean_current(T_r, w, u);
    const DriveCoastSolution solution = drive_coast_invert(T_r, w, target);
    most = std::max(most, solution.iterations);
    ASSERT_NEAR(drive_coast_mean_current(T_r, w, solution.u), target, 1e-13 + 1e-9 * std::abs(target));
    // u itself is only determined as well as the current's slope, d|i|/dv, transports one rounding of the
    // current.
    const double d = 0.5 * (1.0 - std::copysign(1.0, u) * w);
    const double decayed = -std::expm1(-v * T_r);
    const double slope = 2.0 * decayed * d / (1.0 - d + d * decayed);
    if (target != 0.0 && slope > 1e-6) {
      ASSERT_NEAR(solution.u, u, 1e-9) << T_r << " " << w;
    }
  }
  EXPECT_LE(most, kDriveCoastMaxIterations - 1) << "the iteration bound is never reached";
}

TEST(DriveCoast, NeverGivesNaNForTheSmallestTargets) {
  for (const double T_r : {1e-12, 1e-6, 0.289, 10.0, 1e6}) {
    const DriveCoastInverse inverse(T_r);
    for (const double w : {-1.0, -0.999999, -0.9, 0.0, 0.9, 0.999999, 1.0}) {
      for (double target = 1.0; target > 0.0; target *= 1e-3) {
        const double u = inverse.solve(w, target).u;
        ASSERT_TRUE(u >= 0.0 && u <= 1.0) << T_r << " " << w << " " << target;
        ASSERT_EQ(inverse.solve(-w, -target).u, -u);
      }
    }
  }
}

TEST(DriveCoast, MostTargetsOfTheRobotNeedOneStep) {
  const DriveCoastInverse inverse(MotorParameters().T_r());
  int steps = 0;
  int solved = 0;
  for (double w = -0.9; w <= 0.9; w += 0.01) {
    for (double v = 0.005; v < 1.0; v += 0.005) {
      const DriveCoastSolution solution =
          inverse.solve(w, drive_coast_mean_current(MotorParameters().T_r(), w, v));
      ASSERT_LE(solution.iterations, 2);
      ASSERT_NEAR(solution.u, v, 1e-9);
      steps += solution.iterations;
      solved += solution.iterations > 0 ? 1 : 0;
    }
  }
  EXPECT_LT(steps, 1.2 * solved);
}

TEST(DriveCoast, AContinuousCurrentIsSolvedWithoutAStep) {
  const DriveCoastInverse inverse(0.289);
  int continuous = 0;
  for (double w = -0.95; w < 0.955; w += 0.05) {
    for (double v = 0.025; v < 1.0; v += 0.05) {
      const double linear = 2.0 * v - 1.0 - w;  // (4.29)
      if (linear <= 0.0 || std::abs(drive_coast_mean_current(0.289, w, v) - linear) > 1e-12) continue;
      ++continuous;
      const DriveCoastSolution solution = inverse.solve(w, linear);
      EXPECT_NEAR(solution.u, v, 1e-12);
      EXPECT_EQ(solution.iterations, 0);
      EXPECT_TRUE(solution.reachable);
    }
    EXPECT_EQ(inverse.solve(w, 1.01 - w).iterations, 0) << "out of reach";
  }
  EXPECT_GT(continuous, 50);
}

/// Where the current just reaches zero at the period's end, on both sides: there the two forms are nearly
/// one.
TEST(DriveCoast, BothSidesOfTheBoundaryAreToldApart) {
  int tried = 0;
  for (const double T_r : {0.289, 1.0, 2.0, 5.0, 20.0}) {
    const DriveCoastInverse inverse(T_r);
    for (double w = -0.95; w < 0.955; w += 0.05) {
      const double b = 0.5 * (1.0 + w);
      const double d = 0.5 * (1.0 - w);
      const double boundary = 1.0 + std::log(b + d * std::exp(-T_r)) / T_r;  // (4.27)
      for (const double beside : {-1e-2, -1e-3, -1e-4, 1e-4, 1e-3, 1e-2}) {
        const double v = boundary + beside;
        if (v <= 0.0 || v >= 1.0) continue;
        ++tried;
        const double current = drive_coast_mean_current(T_r, w, v);
        EXPECT_NEAR(inverse.solve(w, current).u, v, 1e-11) << T_r << " " << w << " " << beside;
        EXPECT_NEAR(inverse.solve(-w, -current).u, -v, 1e-11);
      }
    }
  }
  EXPECT_GT(tried, 1000);
}

TEST(DriveCoast, LimitsOfVeryHighAndVeryLowPwmFrequency) {
  // (4.35), (4.36)
  EXPECT_NEAR(drive_coast_invert(0.0, 0.3, 0.2).u, (0.2 + 1.0 + 0.3) / 2.0, 1e-12);
  EXPECT_NEAR(drive_coast_invert(1e9, 0.3, 0.2).u, 0.2 / (1.0 - 0.3), 1e-8);
  EXPECT_NEAR(drive_coast_invert(1e9, 0.3, -0.2).u, -0.2 / (1.0 + 0.3), 1e-8);
}

TEST(DriveCoast, BackwardsAtNoLoadSpeedIsAlwaysContinuous) {
  for (const double T_r : {0.289, 600.0, 1e6}) {
    EXPECT_DOUBLE_EQ(drive_coast_mean_current(T_r, -1.0, 0.3), 0.6);  // (4.29) with omega_s = -1
  }
}

TEST(DriveCoast, AWheelFasterThanWithoutLoadIsTakenToBeAsFast) {
  for (const double T_r : {0.0, 0.289, 10.0}) {
    const DriveCoastInverse inverse(T_r);
    for (const double limit : {-1.0, 1.0}) {
      for (const double beyond : {1.001, 1.5, 3.0}) {
        for (const double target : {-0.6, -0.01, 0.01, 0.6}) {
          const DriveCoastSolution at_limit = inverse.solve(limit, target);
          const DriveCoastSolution faster = inverse.solve(beyond * limit, target);
          EXPECT_EQ(faster.u, at_limit.u) << T_r << " " << beyond * limit << " " << target;
          EXPECT_EQ(faster.reachable, at_limit.reachable);
          EXPECT_EQ(drive_coast_mean_current(T_r, beyond * limit, target),
                    drive_coast_mean_current(T_r, limit, target));
        }
      }
    }
  }
}

/// Where one step is not enough a second one is taken.
TEST(DriveCoast, ASlowBridgeIsSolvedAsWell) {
  for (const double T_r : {1.0, 5.0, 40.0}) {
    const DriveCoastInverse inverse(T_r);
    int solved = 0;
    for (double w = -0.98; w < 0.985; w += 0.02) {
      for (double v = 0.01; v < 1.0; v += 0.01) {
        const double target = drive_coast_mean_current(T_r, w, v);
        const DriveCoastSolution solution = inverse.solve(w, target);
        ASSERT_TRUE(solution.reachable) << T_r << " " << w << " " << v;
        ASSERT_NEAR(drive_coast_mean_current(T_r, w, solution.u) / target, 1.0, 1e-11)
            << T_r << " " << w << " " << v;
        solved += solution.iterations > 0 ? 1 : 0;
      }
    }
    EXPECT_GT(solved, 100) << T_r;
  }
}

TEST(DriveCoast, UnreachableTargetsClampAndSaySo) {
  const DriveCoastSolution more = drive_coast_invert(0.289, 0.5, 0.6);  // at most 1 - 0.5
  EXPECT_EQ(more.u, 1.0);
  EXPECT_FALSE(more.reachable);
  const DriveCoastSolution spinning = drive_coast_invert(0.289, 1.0, 0.01);
  EXPECT_EQ(spinning.u, 1.0);
  EXPECT_FALSE(spinning.reachable);
  EXPECT_EQ(drive_coast_invert(0.289, 0.5, 0.0).u, 0.0);
}

/// Where the start is good one step is left to do, and it leaves rounding only.
TEST(DriveCoast, OneStepSolvesAFastBridgeToRounding) {
  for (const double T_r : {0.05, 0.289, 1.0}) {
    const DriveCoastInverse inverse(T_r);
    int solved = 0;
    for (double w = -0.94; w < 0.945; w += 0.02) {
      for (double r = 0.01; r < 0.405; r += 0.01) {
        const double target = 0.25 * r * r * (1.0 - w * w) / T_r;
        const DriveCoastSolution solution = inverse.solve(w, target);
        if (solution.iterations == 0) continue;  // continuous there
        ++solved;
        ASSERT_EQ(solution.iterations, 1) << w << " " << r;
        ASSERT_NEAR(drive_coast_mean_current(T_r, w, solution.u) / target, 1.0, 1e-11) << w << " " << r;
      }
    }
    EXPECT_GT(solved, 100);
  }
}

TEST(DriveCoast, TheSmallestTargetsFollowTheSquareRoot) {
  // u = b r/T_r with r^2 = g T_r/(b d) for r -> 0, b = (1 + w)/2, d = (1 - w)/2
  const double b = 0.3;
  for (const double T_r : {0.289, 10.0}) {
    for (const double r : {2e-21, 9e-21, 1.1e-20, 1e-12}) {
      const double g = r * r * b * (1.0 - b) / T_r;
      EXPECT_NEAR(drive_coast_invert(T_r, 2.0 * b - 1.0, g).u / (b * r / T_r), 1.0, 1e-11) << r;
    }
  }
}

TEST(MotorParameters, OfTheMiniMbbAreTheDissertations) {
  const MotorParameters motor;
  EXPECT_NEAR(motor.T_r(), 0.289, 5e-4);  // [T] section 6.2.3
  EXPECT_NEAR(motor.stall_current_A(8.0), 8.0 / 3.385, 1e-12);
  EXPECT_NEAR(motor.no_load_rad_s(8.0), 8.0 / 0.0742, 1e-9);
  EXPECT_NEAR(motor.k1(), 0.0742 * 8.0 / 3.385, 1e-12);  // (5.12)
  EXPECT_NEAR(motor.k2(), 0.0742 * 0.0742 / 3.385, 1e-12);
}

TEST(Bridge, BelievesABatteryBetweenHalfAndOneAndAHalfOfNominal) {
  const Bridge bridge{MotorParameters()};
  for (const double volts : {4.01, 11.99}) EXPECT_EQ(bridge.supply_V(volts, true), volts);
  for (const double volts : {4.0, 12.0, -7.4}) EXPECT_EQ(bridge.supply_V(volts, true), 8.0) << volts;
}

TEST(Bridge, WithoutInversionIsALinearBridgesDutyWithinFull) {
  MotorParameters motor;
  motor.invert_bridge = false;
  for (const BridgeType type : {BridgeType::kDriveCoast, BridgeType::kDriveBrake}) {
    motor.bridge = type;
    const Bridge bridge(motor);
    EXPECT_DOUBLE_EQ(bridge.invert(0.25, 30.0, 4.0), 0.5);
    EXPECT_EQ(bridge.invert(0.9, 0.0, 4.0), 1.0);
    EXPECT_EQ(bridge.invert(-0.9, 0.0, 4.0), -1.0);
  }
}

TEST(Bridge, WhatIsNotFiniteReachesTheGate) {
  const Bridge bridge{MotorParameters()};
  EXPECT_FALSE(std::isfinite(bridge.invert(std::nan(""), 0.0, 8.0)));
  EXPECT_FALSE(std::isfinite(bridge.invert(0.1, std::numeric_limits<double>::infinity(), 8.0)));
  EXPECT_TRUE(std::isfinite(bridge.invert(0.1, 1e6, 8.0))) << "a wheel may turn faster than without load";
}

TEST(Bridge, ScalesWithTheBatteryAndIgnoresImplausibleReadings) {
  MotorParameters motor;
  motor.bridge = BridgeType::kDriveBrake;
  const Bridge bridge(motor);
  EXPECT_DOUBLE_EQ(bridge.invert(0.5, 0.0, 6.4), 0.5 * 8.0 / 6.4);
  EXPECT_EQ(bridge.supply_V(7.4, true), 7.4);
  EXPECT_EQ(bridge.supply_V(7.4, false), 8.0);
  EXPECT_EQ(bridge.supply_V(1.0, true), 8.0);
  EXPECT_EQ(bridge.supply_V(std::nan(""), true), 8.0);
}

TEST(Bridge, GivesBackWhatItsOutputsLose) {
  MotorParameters motor;
  const Bridge exact(motor);
  motor.bridge_lost_s = 3e-6;  // 0.06 of 50 us
  const Bridge bridge(motor);
  for (const double u : {-0.5, -0.01, 0.02, 0.3}) {
    const double lost = std::copysign(0.06, u);
    EXPECT_DOUBLE_EQ(bridge.invert(u, 0.0, 8.0), exact.invert(u, 0.0, 8.0) + lost) << u;
  }
  EXPECT_EQ(bridge.invert(0.0, 0.0, 8.0), 0.0);
  EXPECT_EQ(bridge.invert(0.999, 0.0, 8.0), 1.0);
}

TEST(Bridge, DriveCoastGivesTheLinearMotorsCurrent) {
  const MotorParameters motor;
  const Bridge bridge(motor);
  for (const double u : {-0.6, -0.1, 0.05, 0.4}) {
    for (const double speed : {-30.0, 0.0, 12.0}) {
      const double omega_r = speed / motor.no_load_rad_s(7.0);
      const double duty = bridge.invert(u, speed, 7.0);
      EXPECT_NEAR(drive_coast_mean_current(motor.T_r(), omega_r, duty), u * 8.0 / 7.0 - omega_r, 1e-12);
    }
  }
}

}  // namespace
}  // namespace equipoise
