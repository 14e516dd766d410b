// The bank of filters with filters that say what a test wants: how much they are surprised depends on which
// wheels they are given. Numbers of ticks follow from the smoothing that the header names: a mean of five
// ticks.
#include "equipoise/estimate/wheel_isolation.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

constexpr int kWheels = 3;

struct World {
  int liar = -1;
  double lie = 8.0;     // what a filter is surprised by that believes the liar
  double noise = 0.01;  // and what any other
  double rate_rad_s = 0.0;
  mutable int updates = 0;  // of all filters
};

struct FakeFilter {
  struct Model {
    static constexpr int kWheel = 3;  // after the gyro
  };
  const World* world;
  double input = 0.0;
  std::array<double, Model::kWheel + kWheels> nis{};
  std::array<bool, kWheels> used{};

  void predict(double u) { input = u; }
  void update(const Measurement<kWheels>& z) {
    ++world->updates;
    used = z.wheel_ok;
    const bool misled = world->liar >= 0 && z.wheel_ok[static_cast<std::size_t>(world->liar)];
    nis.fill(misled ? world->lie : world->noise);
  }
  const auto& row_nis() const { return nis; }
  Vec<kWheels> wheel_rate_rad_s() const { return Vec<kWheels>::Constant(world->rate_rad_s); }
};

using Isolation = WheelIsolation<FakeFilter, kWheels>;

class Isolate : public ::testing::Test {
 protected:
  explicit Isolate(double play_rad = 0.0) : isolation_(filter_, play_rad) { isolation_.reset(); }

  /// A tick of a robot whose wheels turn by `step_rad` and whose encoders disagree with the gyro by `slip`.
  void tick(double slip_rad_s = 0.0, const Vec<kWheels>& step_rad = Vec<kWheels>::Constant(0.01)) {
    z_.imu_ok = z_.encoders_ok = true;
    z_.wheel_angle_rad += step_rad;
    z_.wheel_rate_rad_s = step_rad / kTickS;
    isolation_.step(filter_, 0.5, z_, [&](const Vec<kWheels>& rates) {
      rates_ = rates;
      return slip_rad_s;
    });
  }
  /// Ticks until a wheel is found out, at most `most`; 0: none.
  int ticks_to_find(int most, double slip_rad_s, const Vec<kWheels>& step = Vec<kWheels>::Constant(0.01)) {
    for (int i = 1; i <= most; ++i) {
      tick(slip_rad_s, step);
      if (isolation_.lost() >= 0) return i;
    }
    return 0;
  }
  /// A robot that has been well for a second.
  void settle(int ticks = 200) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void lies(int wheel) { world_.liar = wheel; }

  World world_;
  FakeFilter filter_{&world_};
  Isolation isolation_;
  Measurement<kWheels> z_;
  Vec<kWheels> rates_ = Vec<kWheels>::Zero();
};

TEST_F(Isolate, SoundWheelsAreTrusted) {
  EXPECT_EQ(ticks_to_find(1000, 0.0), 0);
  EXPECT_EQ(isolation_.lost(), -1);
  EXPECT_FALSE(isolation_.stood_still());
  EXPECT_FALSE(isolation_.stands_still());
  EXPECT_FALSE(isolation_.while_arming());
  EXPECT_EQ(filter_.input, 0.5) << "the filter has the input of the tick";
  EXPECT_NEAR(rates_(0), 0.01 / kTickS, 1e-9);
}

TEST_F(Isolate, TheLiarIsTheWheelWithoutWhichTheRestIsExplained) {
  for (int wheel = 0; wheel < kWheels; ++wheel) {
    isolation_.reset();
    z_ = {};
    lies(wheel);
    EXPECT_NE(ticks_to_find(30, 1.0), 0) << wheel;
    EXPECT_EQ(isolation_.lost(), wheel);
    EXPECT_FALSE(isolation_.stood_still()) << "it counts, but wrongly";
  }
}

TEST_F(Isolate, WithoutSlipASurpriseIsNoWheels) {
  lies(1);
  EXPECT_EQ(ticks_to_find(300, 0.0), 0);
  EXPECT_EQ(ticks_to_find(300, 0.29), 0) << "pushes come so far";
  EXPECT_NE(ticks_to_find(60, 0.35), 0);
}

TEST_F(Isolate, SlipOfEitherSignCounts) {
  lies(1);
  EXPECT_NE(ticks_to_find(30, -1.0), 0);
}

TEST_F(Isolate, WithoutASurpriseSlipIsNoWheels) {
  lies(1);
  world_.lie = 0.99;
  EXPECT_EQ(ticks_to_find(500, 1.0), 0);
  world_.lie = 1.1;
  EXPECT_NE(ticks_to_find(100, 1.0), 0);
}

TEST_F(Isolate, TheBankRunsAfterArmingAndUnderSuspicionOnly) {
  const auto runs_after = [&](int ticks, double slip_rad_s) {
    for (int i = 1; i < ticks; ++i) tick(slip_rad_s);
    world_.updates = 0;
    tick(slip_rad_s);
    return world_.updates == 1 + kWheels;
  };
  EXPECT_TRUE(runs_after(1, 0.0));
  EXPECT_TRUE(runs_after(99, 0.0));
  EXPECT_FALSE(runs_after(5, 0.0));
  EXPECT_FALSE(runs_after(60, 0.14)) << "pushes come so far";
  EXPECT_TRUE(runs_after(60, 0.16));
  EXPECT_FALSE(runs_after(150, 0.0)) << "that is over";
  world_.noise = 0.49;
  EXPECT_FALSE(runs_after(60, 0.0));
  world_.noise = 0.51;
  EXPECT_TRUE(runs_after(60, 0.0));
}

TEST_F(Isolate, ASurpriseThatNoWheelExplainsBlamesNone) {
  settle();
  world_.noise = 100.0;
  tick();
  world_.noise = 0.01;
  EXPECT_EQ(ticks_to_find(100, 3.0), 0);
}

TEST_F(Isolate, AWheelMustExplainThreeQuartersOfTheSurprise) {
  lies(2);
  world_.lie = 8.0;
  world_.noise = 2.1;
  EXPECT_EQ(ticks_to_find(500, 1.0), 0);
  world_.noise = 1.9;
  isolation_.reset();
  EXPECT_NE(ticks_to_find(200, 1.0), 0);
}

TEST_F(Isolate, TheTrialIsOverAfterEightyTicksAndArmingAfterAHundred) {
  settle(80);
  EXPECT_TRUE(isolation_.checking());
  tick();
  EXPECT_FALSE(isolation_.checking());
  lies(0);
  ASSERT_NE(ticks_to_find(19, 2.0), 0);
  EXPECT_TRUE(isolation_.while_arming());
  isolation_.reset();
  lies(-1);
  settle(200);
  lies(0);
  ASSERT_NE(ticks_to_find(60, 2.0), 0);
  EXPECT_FALSE(isolation_.while_arming());
}

TEST_F(Isolate, NothingIsFoundInTheFirstTicks) {
  lies(1);
  world_.lie = 100.0;
  const int found = ticks_to_find(30, 50.0);
  EXPECT_EQ(found, 5 + 2) << "three hits in a row from the fifth tick on";
}

TEST_F(Isolate, AfterwardsTheFilterGoesOnWithoutTheLiar) {
  lies(1);
  ASSERT_NE(ticks_to_find(30, 1.0), 0);
  tick(1.0);
  EXPECT_EQ(filter_.used, (std::array<bool, kWheels>{true, false, true}));
  EXPECT_TRUE(z_.wheel_ok[1]) << "the sample itself is left alone";
  for (int i = 0; i < 500; ++i) tick(1.0);
  EXPECT_EQ(isolation_.lost(), 1) << "and only one is ever left out";
  EXPECT_FALSE(isolation_.checking());
}

TEST_F(Isolate, DisarmingTrustsEveryWheelAgain) {
  lies(1);
  ASSERT_NE(ticks_to_find(30, 1.0), 0);
  isolation_.reset();
  EXPECT_EQ(isolation_.lost(), -1);
  EXPECT_EQ(isolation_.slip_rad_s(), 0.0);
  EXPECT_FALSE(isolation_.while_arming());
  EXPECT_TRUE(isolation_.checking());
  lies(-1);
  EXPECT_EQ(ticks_to_find(300, 0.0), 0);
  EXPECT_EQ(filter_.used, (std::array<bool, kWheels>{true, true, true}));
}

TEST_F(Isolate, AWheelThatStandsStillWhileItShouldTurnNeedsLessEvidence) {
  lies(1);
  world_.lie = 4.0;
  world_.noise = 2.5;  // explains too little of it for a wheel that counts
  world_.rate_rad_s = 2.0;
  EXPECT_EQ(ticks_to_find(300, 1.0), 0);
  const Vec<kWheels> second_still(0.01, 0.0, 0.01);
  EXPECT_NE(ticks_to_find(60, 1.0, second_still), 0);
  EXPECT_EQ(isolation_.lost(), 1);
  EXPECT_TRUE(isolation_.stood_still());
  EXPECT_TRUE(isolation_.stands_still());
  tick(1.0);
  EXPECT_FALSE(isolation_.stands_still()) << "it counts again";
  EXPECT_TRUE(isolation_.stood_still()) << "then it did not";
}

TEST_F(Isolate, AWheelThatStandsStillBecauseTheRobotDoesIsNone) {
  lies(1);
  world_.lie = 4.0;
  world_.noise = 2.5;
  world_.rate_rad_s = 1.4;
  EXPECT_EQ(ticks_to_find(300, 1.0, Vec<kWheels>(0.01, 0.0, 0.01)), 0);
}

TEST_F(Isolate, AWheelStandsStillAsTheOthersDo) {
  lies(1);
  world_.lie = 4.0;
  world_.noise = 2.5;
  world_.rate_rad_s = 2.0;
  EXPECT_EQ(ticks_to_find(300, 1.0, Vec<kWheels>(0.007, 0.0, 0.007)), 0) << "1.4 rad/s";
  EXPECT_NE(ticks_to_find(60, 1.0, Vec<kWheels>(0.008, 0.0, 0.0)), 0);
  EXPECT_EQ(isolation_.lost(), 1);
}

TEST_F(Isolate, SlipOfWheelsThatAllStandStillIsHeldSlip) {
  settle();
  for (int i = 0; i < 60; ++i) tick(-1.0, Vec<kWheels>(0.0, 0.0, 0.01));
  EXPECT_EQ(isolation_.held_slip_rad_s(), 0.0) << "one turns";
  for (int i = 0; i < 5; ++i) tick(-1.0, Vec<kWheels>::Zero());
  EXPECT_EQ(isolation_.held_slip_rad_s(), 0.0) << "they stand for 5 ticks";
  tick(-1.0, Vec<kWheels>::Zero());
  EXPECT_NEAR(isolation_.held_slip_rad_s(), -1.0, 1e-3);
  for (int i = 0; i < 60; ++i) tick(0.29, Vec<kWheels>::Zero());
  EXPECT_EQ(isolation_.held_slip_rad_s(), 0.0) << "hardly any";
}

TEST_F(Isolate, SlipIsSmoothedOverAboutSevenTicks) {
  tick(1.0);
  EXPECT_EQ(isolation_.slip_rad_s(), 0.0) << "a rate needs two angles";
  tick(1.0);
  EXPECT_NEAR(isolation_.slip_rad_s(), 0.15, 1e-12);
  tick(1.0);
  EXPECT_NEAR(isolation_.slip_rad_s(), 1.0 - 0.85 * 0.85, 1e-12);
}

TEST_F(Isolate, ASampleWithAGapTellsNoSlip) {
  const auto gap = [&](auto&& change) {
    isolation_.reset();
    tick(1.0);
    tick(1.0);
    const double before = isolation_.slip_rad_s();
    Measurement<kWheels> broken = z_;
    change(broken);
    isolation_.step(filter_, 0.0, broken, [](const Vec<kWheels>&) { return 100.0; });
    isolation_.step(filter_, 0.0, z_, [](const Vec<kWheels>&) { return 100.0; });  // nor the next
    return isolation_.slip_rad_s() == before;
  };
  EXPECT_TRUE(gap([](auto& z) { z.encoders_ok = false; }));
  EXPECT_TRUE(gap([](auto& z) { z.imu_ok = false; }));
  EXPECT_TRUE(gap([](auto& z) { z.ticks = 2; }));
  isolation_.reset();
  tick(1.0);
  tick(1.0);
  z_.gyro_axis_ok[2] = false;
  tick(1.0);
  EXPECT_EQ(isolation_.slip_rad_s(), 0.0) << "without the gyro about z nothing is known of it";
}

class IsolateWithPlay : public Isolate {
 protected:
  IsolateWithPlay() : Isolate(0.1) {}
};

TEST_F(IsolateWithPlay, ASlipWithinTheGearsIsNone) {
  lies(1);
  // 0.42 rad/s for a while comes to 0.105 rad with what is forgotten of it, 0.39 to 0.0975.
  EXPECT_EQ(ticks_to_find(400, 0.39), 0);
  EXPECT_NE(ticks_to_find(400, 0.42), 0);
}

TEST_F(IsolateWithPlay, AWheelThatStandsWhileTheOthersTurnBeyondPlayIsFoundSlowly) {
  lies(2);
  const Vec<kWheels> third_still(0.001, 0.001, 0.0);
  // 0.2 rad/s: 0.15 rad after 150 ticks.
  const int found = ticks_to_find(400, 0.2, third_still);
  EXPECT_GE(found, 150);
  EXPECT_LE(found, 156);
  EXPECT_EQ(isolation_.lost(), 2);
  EXPECT_TRUE(isolation_.stood_still());
}

TEST_F(IsolateWithPlay, AWheelThatMovesInBetweenBeginsAnew) {
  lies(2);
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(ticks_to_find(140, 0.2, Vec<kWheels>(0.001, 0.001, 0.0)), 0);
    tick(0.2, Vec<kWheels>(0.001, 0.001, 0.001));
  }
}

TEST(IsolationReport, SaysWhatTheRobotDoesWithout) {
  World world;
  world.liar = 2;
  FakeFilter filter{&world};
  Isolation isolation(filter);
  isolation.reset();
  EstimatorHealth<kWheels> health;
  report(isolation, &health);
  EXPECT_EQ(health.lost, 0U);
  EXPECT_TRUE(health.checking);
  EXPECT_TRUE(health.predicts_wheels);
  EXPECT_FALSE(health.while_arming);
  Measurement<kWheels> z;
  z.imu_ok = z.encoders_ok = true;
  for (int i = 0; i < 30; ++i) {
    z.wheel_angle_rad += Vec<kWheels>(0.01, 0.01, 0.0);
    isolation.step(filter, 0.0, z, [](const Vec<kWheels>&) { return 1.0; });
  }
  report(isolation, &health);
  EXPECT_EQ(health.lost, 4U);
  EXPECT_TRUE(health.stood_still);
  EXPECT_TRUE(health.while_arming);
  EXPECT_FALSE(health.checking);
}

}  // namespace
}  // namespace equipoise
