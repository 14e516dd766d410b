// Which of two wheels lies, when either explains it: the likelier one is left
// out on trial. Filters that say what a test wants, as surprised as the wheel
// that they are without.
#include <gtest/gtest.h>

#include "equipoise/estimate/wheel_isolation.hpp"

namespace equipoise {
namespace {

constexpr int kWheels = 2;

struct Surprises {
  double with_all = 0.01;
  std::array<double, kWheels> without{0.01, 0.01};
  mutable int updates = 0;  // of all filters
};

struct FakeFilter {
  struct Model {
    static constexpr int kWheel = 3;  // after the gyro
  };
  const Surprises* surprises;
  int ticks = 0;  // that this filter has run
  std::array<double, Model::kWheel + kWheels> nis{};

  void predict(double /*u*/) {}
  void update(const Measurement<kWheels>& z) {
    ++surprises->updates;
    ++ticks;
    double surprise = surprises->with_all;
    for (std::size_t i = 0; i < kWheels; ++i)
      if (!z.wheel_ok[i]) surprise = surprises->without[i];
    nis.fill(surprise);
  }
  const auto& row_nis() const { return nis; }
  Vec<kWheels> wheel_rate_rad_s() const { return Vec<kWheels>::Zero(); }
};

class Trial : public ::testing::Test {
 protected:
  Trial() { isolation_.reset(); }

  /// Ticks of a robot whose encoders disagree with the gyro about the spin by
  /// `slip_rad_s_`.
  void run(int ticks, const Vec<kWheels>& step_rad = Vec<kWheels>::Constant(0.01)) {
    for (int i = 0; i < ticks; ++i) {
      z_.imu_ok = z_.encoders_ok = true;
      z_.wheel_angle_rad += step_rad;
      isolation_.step(filter_, 0.0, z_, [&](const Vec<kWheels>&) { return slip_rad_s_; });
    }
  }
  int updates_of_a_tick() {
    surprises_.updates = 0;
    run(1);
    return surprises_.updates;
  }
  /// The filter with all wheels lost track a while ago; without either of them
  /// it would not have.
  void lose_track(std::array<double, kWheels> without, const Vec<kWheels>& step_rad = Vec2(0.01, 0.01)) {
    run(WheelIsolation<FakeFilter, kWheels>::kArmingTicks);
    surprises_ = {40.0, without};
    run(40, step_rad);
  }

  Surprises surprises_;
  double slip_rad_s_ = 0.0;
  FakeFilter filter_{&surprises_, 0, {}};
  WheelIsolation<FakeFilter, kWheels> isolation_{filter_, 0.03};
  Measurement<kWheels> z_;
};

TEST_F(Trial, TheLikelierWheelIsLeftOut) {
  lose_track({0.3, 0.5});
  EXPECT_EQ(isolation_.lost(), 0);
  EXPECT_FALSE(isolation_.stood_still());
  EXPECT_FALSE(isolation_.while_arming());
  isolation_.reset();
  EXPECT_EQ(isolation_.lost(), -1);
  surprises_ = {};
  lose_track({0.5, 0.3});
  EXPECT_EQ(isolation_.lost(), 1);
}

TEST_F(Trial, OneThatStandsStillIsLikelier) {
  lose_track({0.3, 0.5}, Vec2(0.01, 0.0));
  EXPECT_EQ(isolation_.lost(), 1);
  EXPECT_TRUE(isolation_.stood_still());
}

TEST_F(Trial, NotBeforeTheFilterIsSurprisedByMuchForLong) {
  run(100);
  surprises_ = {9.9, {0.3, 0.5}};
  run(400);
  EXPECT_EQ(isolation_.lost(), -1);
  surprises_.with_all = 40.0;
  run(9);
  EXPECT_EQ(isolation_.lost(), -1) << "a knock is over sooner";
  run(3);
  EXPECT_EQ(isolation_.lost(), 0);
}

TEST_F(Trial, NotWhereAWheelDoesNotExplainIt) {
  lose_track({0.3, 4.3});
  EXPECT_EQ(isolation_.lost(), -1);
  surprises_.without = {0.3, 3.7};
  run(40);
  EXPECT_EQ(isolation_.lost(), 0);
}

TEST_F(Trial, NotWithoutTheGyrosYawRate) {
  z_.gyro_axis_ok[2] = false;
  lose_track({0.3, 0.5});
  EXPECT_EQ(isolation_.lost(), -1) << "the wheels give it";
  z_.gyro_axis_ok = {false, false, true};
  run(1);
  EXPECT_EQ(isolation_.lost(), 0);
}

TEST_F(Trial, NotWhileArming) {
  surprises_ = {40.0, {0.3, 0.5}};
  run(100);
  EXPECT_EQ(isolation_.lost(), -1) << "there is time to name the wheel";
  run(1);
  EXPECT_EQ(isolation_.lost(), 0);
}

TEST_F(Trial, AnotherWheelInsteadWhenThatExplainsMore) {
  lose_track({0.3, 0.5});
  surprises_.without = {0.9, 0.1};
  run(60);
  EXPECT_EQ(isolation_.lost(), 0) << "it is hardly surprised";
  surprises_.without = {0.9, 0.6};
  run(60);
  surprises_.without = {5.0, 2.6};
  run(60);
  EXPECT_EQ(isolation_.lost(), 0) << "nor would it be much less without the other";
  surprises_.without = {5.0, 2.0};
  run(12);
  EXPECT_EQ(isolation_.lost(), 1);
  surprises_.without = {0.1, 5.0};
  run(12);
  EXPECT_EQ(isolation_.lost(), 0) << "and back";
}

TEST_F(Trial, EveryFilterGoesOn) {
  lose_track({0.3, 0.5});
  surprises_.without = {5.0, 0.1};
  run(12);
  ASSERT_EQ(isolation_.lost(), 1);
  EXPECT_DOUBLE_EQ(filter_.nis[0], 0.1) << "that of the other wheel";
  EXPECT_EQ(filter_.ticks, 152);
  surprises_.without = {0.1, 5.0};
  run(12);
  ASSERT_EQ(isolation_.lost(), 0);
  EXPECT_EQ(filter_.ticks, 164);
}

TEST_F(Trial, ItEndsWhenTheOthersAreRefuted) {
  lose_track({0.3, 0.5});
  EXPECT_EQ(updates_of_a_tick(), kWheels);
  surprises_.without = {0.1, 0.9};
  run(100);
  EXPECT_EQ(updates_of_a_tick(), kWheels) << "the other is hardly surprised";
  surprises_.without = {0.3, 5.0};
  run(50);
  EXPECT_EQ(updates_of_a_tick(), kWheels);
  run(20);
  EXPECT_EQ(updates_of_a_tick(), 1);
  surprises_.without = {5.0, 0.1};
  run(60);
  EXPECT_EQ(isolation_.lost(), 0) << "what surprises now is something else";
}

TEST_F(Trial, AWheelThatIsClearlyTheLiarIsOnNone) {
  lose_track({0.3, 0.5});
  ASSERT_EQ(updates_of_a_tick(), kWheels);
  isolation_.reset();
  surprises_ = {};
  run(100);
  surprises_ = {40.0, {0.3, 40.0}};
  slip_rad_s_ = 1.0;
  run(30);
  EXPECT_EQ(isolation_.lost(), 0);
  EXPECT_EQ(updates_of_a_tick(), 1);
}

/// Safety starts to count anew with every wheel that is left out.
TEST_F(Trial, ItEndsAfterFourChanges) {
  lose_track({0.3, 0.5});
  int changes = 0;
  for (int i = 0; i < 20; ++i) {
    const auto lost = static_cast<std::size_t>(isolation_.lost());
    surprises_.without[lost] = 50.0;
    surprises_.without[1 - lost] = 0.1;
    run(30);
    changes += isolation_.lost() == static_cast<int>(lost) ? 0 : 1;
  }
  EXPECT_EQ(changes, 4);
  isolation_.reset();
  surprises_ = {};
  lose_track({0.3, 0.5});
  surprises_.without = {5.0, 0.1};
  run(12);
  EXPECT_EQ(isolation_.lost(), 1) << "armed again, it may change again";
}

}  // namespace
}  // namespace equipoise
