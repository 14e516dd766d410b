// The parts of a replay: errors against the truth, the first number that differs, what counts and what is
// judged.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "app/log/replay.hpp"
#include "robots/mbbr/mbbr.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise {
namespace {

using app::Difference;
using runtime::TickRecord;

TEST(ReplayErrors, AreRootMeanSquares) {
  app::ReplayErrors errors;
  EXPECT_TRUE(errors.json(0.1).is_null());
  runtime::StateRecord truth{};
  runtime::StateRecord x{};
  x.theta_rad[0] = 0.03;
  x.theta_rad[1] = -0.04;
  x.theta_rad[2] = 9.0;  // yaw has no say
  x.phi_dot_rad_s[0] = 3.0;
  x.position_W_m[0] = 0.3;
  x.position_W_m[1] = 0.4;
  errors.add(x, truth);
  errors.add(truth, truth);
  const auto json = errors.json(0.1);
  EXPECT_EQ(json["ticks"], 2);
  EXPECT_NEAR(json["attitude_rmse_rad"].get<double>(), 0.05 / 2.0, 1e-12);
  EXPECT_NEAR(json["rolling_rate_rmse_rad_s"].get<double>(), 1.5, 1e-12);
  EXPECT_NEAR(json["rolling_speed_rmse_m_s"].get<double>(), 0.15, 1e-12);
  EXPECT_NEAR(json["position_rmse_m"].get<double>(), 0.5 / std::sqrt(2.0), 1e-12);
}

TEST(ReplayErrors, OfATuningAreMeansOverItsTicks) {
  app::Retuned::Figures figures;
  EXPECT_TRUE(figures.json(0, 0.1).is_null());
  figures.duty_squared = 1.0;
  figures.innovation = 6.0;
  figures.saturated = 3;
  const auto json = figures.json(4, 0.1);
  EXPECT_DOUBLE_EQ(json["duty_rms"], 0.5);
  EXPECT_DOUBLE_EQ(json["normalized_innovation_mean"], 1.5);
  EXPECT_DOUBLE_EQ(json["saturated_fraction"], 0.75);
  EXPECT_TRUE(json["errors"].is_null());
}

Difference compared(const TickRecord& logged, const TickRecord& replayed) {
  Difference d;
  app::compare(logged, replayed, &d);
  return d;
}

TEST(Compare, FindsTheFirstNumberThatDiffersInAnyBit) {
  TickRecord logged{};
  logged.tick = 7;
  TickRecord replayed = logged;
  EXPECT_FALSE(compared(logged, replayed).found);
  replayed.estimate.theta_rad[1] = std::numeric_limits<double>::denorm_min();
  replayed.motors.duty[0] = 1.0;
  const Difference d = compared(logged, replayed);
  EXPECT_TRUE(d.found);
  EXPECT_EQ(d.tick, 7);
  EXPECT_EQ(d.field, "EQUIPOISE_STATE.theta_rad[1]");
  EXPECT_EQ(d.logged, 0.0);
  EXPECT_EQ(d.replayed, std::numeric_limits<double>::denorm_min());
}

TEST(Compare, KnowsPlainFieldsMotorsAndHealth) {
  const TickRecord logged{};
  TickRecord replayed{};
  replayed.motors.duty[2] = -0.0;
  EXPECT_EQ(compared(logged, replayed).field, "EQUIPOISE_MOTORS.duty[2]") << "another zero is another number";
  replayed = {};
  replayed.degraded = 1;
  EXPECT_EQ(compared(logged, replayed).field, "EQUIPOISE_HEALTH.degraded");
  replayed = {};
  replayed.raw.gyro_counts[0] = 1.0;
  replayed.velocity_W_m_s[0] = 1.0;
  EXPECT_FALSE(compared(logged, replayed).found) << "what went into the tick was not computed";
}

TEST(Compare, KnowsWhatWasWeighedWhereTheLogDoes) {
  TickRecord logged{};
  TickRecord replayed{};
  replayed.faults = {3, 2.0, 18.6, -1, 0.0, false, 0};
  EXPECT_FALSE(compared(logged, replayed).found) << "an older log";
  logged.faults = replayed.faults;
  EXPECT_FALSE(compared(logged, replayed).found);
  replayed.faults.ratio = 2.5;
  EXPECT_EQ(compared(logged, replayed).field, "EQUIPOISE_FAULTS.ratio");
}

TEST(Compare, AnyNaNIsAnyOtherAndNoNumber) {
  TickRecord logged{};
  TickRecord replayed{};
  logged.motors.duty[0] = std::numeric_limits<double>::quiet_NaN();
  replayed.motors.duty[0] = -std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(compared(logged, replayed).found);
  replayed.motors.duty[0] = 0.0;
  EXPECT_TRUE(compared(logged, replayed).found);
  EXPECT_TRUE(compared(replayed, logged).found);
}

TEST(Compare, KeepsTheFirstTicksDifference) {
  Difference d;
  TickRecord replayed{};
  replayed.motors.duty[0] = 1.0;
  TickRecord logged{};
  logged.tick = 1;
  app::compare(logged, replayed, &d);
  logged.tick = 2;
  app::compare(logged, replayed, &d);
  EXPECT_EQ(d.tick, 1);
  EXPECT_EQ(d.field, "EQUIPOISE_MOTORS.duty[0]");
}

TEST(Judged, ByTheTruthAndItsClockWhereThereIsOne) {
  TickRecord r{};
  r.tick = 300;
  r.now_ns = 9'000'000'000;
  r.arm = true;
  r.reasons = 5;
  r.arm_state = static_cast<std::int32_t>(ArmState::kArmed);
  app::VerdictJudge::Tick t = app::judged(r);
  EXPECT_DOUBLE_EQ(t.t_s, 1.5) << "200 Hz";
  EXPECT_TRUE(std::isnan(t.true_tilt_rad));
  r.has_truth = true;
  r.truth.theta_rad[0] = 0.3;
  r.truth.theta_rad[1] = -0.4;
  t = app::judged(r);
  EXPECT_DOUBLE_EQ(t.t_s, 9.0);
  EXPECT_DOUBLE_EQ(t.true_tilt_rad, 0.5);
}

TEST(Settled, IsFromTheFifthSecondOn) {
  TickRecord r{};
  r.now_ns = 60'000'000'000;  // a robot's clock starts anywhere
  r.tick = 999;
  EXPECT_FALSE(app::settled(r));
  r.tick = 1000;
  EXPECT_TRUE(app::settled(r));
  r.has_truth = true;
  r.now_ns = 4'999'999'999;
  EXPECT_FALSE(app::settled(r));
  r.now_ns = 5'000'000'000;
  EXPECT_TRUE(app::settled(r));
}

TEST(Recall, GivesWhatTheSimulationKnew) {
  runtime::StateRecord s{};
  for (std::size_t i = 0; i < 3; ++i) {
    s.theta_rad[i] = 0.1 * static_cast<double>(1 + i);
    s.omega_B_rad_s[i] = 1.0 + static_cast<double>(i);
  }
  s.phi_rad[0] = 4.0;
  s.phi_rad[1] = 5.0;
  s.phi_dot_rad_s[0] = 6.0;
  s.phi_dot_rad_s[1] = 7.0;
  MbbrEstimate x;
  ASSERT_TRUE(recall(runtime::to_view(s), &x));
  EXPECT_EQ(x.theta_xy, Vec2(s.theta_rad[0], s.theta_rad[1]));
  EXPECT_EQ(x.theta_z, s.theta_rad[2]);
  EXPECT_EQ(x.omega_B, Vec3(1.0, 2.0, 3.0));
  EXPECT_EQ(x.theta_dot, euler_rates(x.theta_xy, x.omega_B));
  EXPECT_EQ(x.phi, Vec2(4.0, 5.0));
  EXPECT_EQ(x.phi_dot_star, Vec2(6.0, 7.0));
  MipEstimate of_another_robot;
  EXPECT_FALSE(recall(runtime::to_view(s), &of_another_robot)) << "its log does not hold all of it";
}

}  // namespace
}  // namespace equipoise
