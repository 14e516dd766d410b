// The MBBR through the real pipeline, hardware boundary and exact world. Given / when / then.
#include <gtest/gtest.h>

#include "app/sim/simulate.hpp"
#include "config/population.hpp"
#include "robots/robot_list.hpp"

namespace equipoise {
namespace {

using app::SimSummary;

const std::string kMbbr = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";

struct Setting {
  const char* controller = "scheduled";
  double yaw_hz = 0.0;
  double drive_mps = 0.0;
  double duration_s = 30.0;
  std::uint64_t seed = 1;
  Fidelity fidelity = Fidelity::kNominal;
  bool compare = false;
};

SimSummary run(const Setting& o, MbbrEstimatorId estimator, const std::vector<std::string>& set = {}) {
  static const std::atomic<bool> never{false};
  const auto name = [](const auto& names, auto value) { return names[static_cast<std::size_t>(value)]; };
  const app::Choice choice{name(kMbbrEstimatorNames, estimator), o.controller,
                           name(kFidelityNames, o.fidelity), o.compare};
  const app::SimOptions options{{true, o.drive_mps, 2.0 * kPi * o.yaw_hz}, o.duration_s, o.seed};
  return app::simulate(*app::load_robot(kMbbr, set), choice, options, nullptr, never);
}

struct Drive {
  double yaw_hz;
  double drive_mps;
};

// [T] section 6.4.5: the drive rates at each yaw rate.
constexpr Drive kThesisDrives[] = {{0.0, 0.20}, {0.5, 0.20}, {0.75, 0.15}, {1.0, 0.10}};

SimSummary drive(const Drive& rates, std::uint64_t seed, Fidelity fidelity, MbbrEstimatorId estimator) {
  return run({"thesis", rates.yaw_hz, rates.drive_mps, 60.0, seed, fidelity}, estimator);
}

class ThesisController : public testing::TestWithParam<Drive> {};

TEST_P(ThesisController, HoldsTheIdealWorldWithTrueStatesForEverySeed) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SimSummary s = drive(GetParam(), seed, Fidelity::kIdeal, MbbrEstimatorId::kTruth);
    EXPECT_FALSE(s.verdict.fell()) << "seed " << seed << " at " << s.verdict.fell_at_s << " s";
    EXPECT_NEAR(s.yaw_rate_mean_hz, GetParam().yaw_hz, 0.01);
    EXPECT_LT(s.position_rmse_m, 0.10);
  }
}
INSTANTIATE_TEST_SUITE_P(DriveRates, ThesisController, testing::ValuesIn(kThesisDrives));

class KfAttitude : public testing::TestWithParam<Drive> {};

TEST_P(KfAttitude, HoldsTheThesisWorldForEverySeed) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SimSummary s = drive(GetParam(), seed, Fidelity::kThesis, MbbrEstimatorId::kKfAttitude);
    EXPECT_FALSE(s.verdict.fell()) << "seed " << seed << " at " << s.verdict.fell_at_s << " s";
  }
}
INSTANTIATE_TEST_SUITE_P(DriveRates, KfAttitude, testing::Values(Drive{0.0, 0.20}, Drive{0.5, 0.20}));

class Comparison : public testing::TestWithParam<Drive> {};

TEST_P(Comparison, CorrectedFiltersBeatThePrintedOneOnTheSameSamples) {
  for (const Fidelity fidelity : {Fidelity::kThesis, Fidelity::kNominal}) {
    for (int seed = 1; seed <= 3; ++seed) {
      Setting o;
      o.yaw_hz = GetParam().yaw_hz;
      o.drive_mps = GetParam().drive_mps;
      o.duration_s = 30.0;
      o.seed = static_cast<std::uint64_t>(seed);
      o.fidelity = fidelity;
      o.compare = true;
      const SimSummary s = run(o, MbbrEstimatorId::kEkf);
      ASSERT_FALSE(s.verdict.fell());
      const auto& printed = s.estimators.at("ekf13_published");
      for (const char* name : {"ekf", "ekf13"}) {
        const auto& corrected = s.estimators.at(name);
        EXPECT_LT(corrected.attitude_rmse_rad, 0.5 * printed.attitude_rmse_rad) << name;
        EXPECT_LT(corrected.speed_rmse, 0.7 * printed.speed_rmse) << name;
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(YawRates, Comparison,
                         testing::Values(Drive{0.75, 0.15}, Drive{1.0, 0.10}, Drive{1.5, 0.05}));

class Defaults : public testing::TestWithParam<Drive> {};

TEST_P(Defaults, SpinAndDriveInTheFullWorld) {
  for (int seed = 1; seed <= 5; ++seed) {
    Setting o;
    o.yaw_hz = GetParam().yaw_hz;
    o.drive_mps = GetParam().drive_mps;
    o.seed = static_cast<std::uint64_t>(seed);
    const SimSummary s = run(o, MbbrEstimatorId::kEkf);
    EXPECT_FALSE(s.verdict.fell()) << "seed " << seed << " at " << s.verdict.fell_at_s << " s";
    EXPECT_NEAR(s.yaw_rate_mean_hz, o.yaw_hz, 0.02);
    EXPECT_LT(s.controlling.attitude_rmse_rad, 0.02);
  }
}
INSTANTIATE_TEST_SUITE_P(DriveRates, Defaults,
                         testing::Values(Drive{0.0, 0.20}, Drive{0.5, 0.20}, Drive{1.0, 0.10},
                                         Drive{-1.0, 0.10}, Drive{1.5, 0.05}));

TEST(Simulation, SameSeedGivesTheSameNumbersAndAnotherSeedOthers) {
  Setting o;
  o.yaw_hz = 1.0;
  o.drive_mps = 0.1;
  o.duration_s = 8.0;
  const SimSummary a = run(o, MbbrEstimatorId::kEkf);
  const SimSummary b = run(o, MbbrEstimatorId::kEkf);
  o.seed = 2;
  const SimSummary c = run(o, MbbrEstimatorId::kEkf);
  EXPECT_EQ(a.controlling.attitude_rmse_rad, b.controlling.attitude_rmse_rad);
  EXPECT_EQ(a.position_rmse_m, b.position_rmse_m);
  EXPECT_NE(a.controlling.attitude_rmse_rad, c.controlling.attitude_rmse_rad);
}

TEST(Simulation, APrintedSlcSignOrEulerRatesFallWhereOursHold) {
  // physics: the printed minus of (6.13) is unstable under the dissertation's own conventions.
  Setting o;
  o.controller = "thesis";
  o.duration_s = 60.0;
  o.drive_mps = 0.1;
  o.fidelity = Fidelity::kIdeal;
  EXPECT_FALSE(run(o, MbbrEstimatorId::kTruth).verdict.fell());
  EXPECT_TRUE(run(o, MbbrEstimatorId::kTruth, {"reference.slc_sign=-1.0"}).verdict.fell());
  o.yaw_hz = 1.0;
  EXPECT_FALSE(run(o, MbbrEstimatorId::kTruth).verdict.fell());
  EXPECT_TRUE(run(o, MbbrEstimatorId::kTruth, {"reference.rate_feedback=euler"}).verdict.fell());
}

TEST(Simulation, NoiseThroughTheTorquesBeatsADiagonalUnderFriction) {
  // The reason why config/mbbr.toml departs from (6.31) and (6.23).
  Setting o;
  o.controller = "thesis";
  o.drive_mps = 0.2;
  const SimSummary ours = run(o, MbbrEstimatorId::kEkf);
  const SimSummary printed =
      run(o, MbbrEstimatorId::kEkf,
          {"estimator.ekf.q=[1e-5,1e-5,1e-4,1e-4,1e-4,0.1,0.1,2.0,1e-3,1e-3,1e-10,1e-10,1e-11,1e-11,0,0,0,0]",
           "estimator.ekf.r=[2.08e-6,2.08e-6,2.08e-6,4.99e-4,4.99e-4,4.99e-4,1.41,1.41]",
           "estimator.ekf.input_variance=[0.0,0.0,0.0]"});
  EXPECT_LT(ours.controlling.attitude_rmse_rad, 0.3 * printed.controlling.attitude_rmse_rad);
  EXPECT_LT(ours.controlling.speed_rmse, 0.6 * printed.controlling.speed_rmse);
}

TEST(Simulation, RecoversFromAPush) {
  Setting o;
  o.duration_s = 10.0;
  const std::vector<std::string> push{
      "world.nominal.pushes=[{at_s=5.0, duration_s=0.05, force_N=[4.0, 0.0]}]"};
  const double unpushed = run(o, MbbrEstimatorId::kEkf).duty_max;
  for (o.seed = 1; o.seed <= 8; ++o.seed) {
    const SimSummary s = run(o, MbbrEstimatorId::kEkf, push);
    EXPECT_FALSE(s.verdict.fell()) << "seed " << o.seed;
    EXPECT_GT(s.duty_max, unpushed) << "the push was felt";
  }
}

/// In `full` wheels slip on the ball all the time. While the control's filter followed them, 21 of these 40
/// runs stood; with nothing judged 36 do.
TEST(MbbrThatSlips, MostlyStands) {
  static const std::atomic<bool> never{false};
  int stood = 0;
  for (std::int64_t robot = 921; robot <= 940; ++robot) {
    const auto drawn = config::with_robot_drawn(config::draw_robot(kMbbr, {}, "full", robot), "full", {});
    for (const double yaw_hz : {0.0, 1.0}) {
      const app::SimOptions options{{true, 0.0, 2.0 * kPi * yaw_hz}, 8.0, static_cast<std::uint64_t>(robot)};
      const app::Choice choice{"ekf", "scheduled", "full", false, "dmp"};
      const SimSummary s = app::simulate(*app::load_robot(kMbbr, drawn), choice, options, nullptr, never);
      stood += s.verdict.fell() ? 0 : 1;
    }
  }
  EXPECT_GE(stood, 30);
}

}  // namespace
}  // namespace equipoise
