// Robots in vector registers against the same robots one by one.
#include "equipoise/plant/lanes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "robots/lanes/roll.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise {
namespace {

MbbrWorldParams nominal(std::uint64_t seed) {
  MbbrWorldParams world;
  world.common.seed = seed;
  world.common.battery_resistance_ohm = 0.15;
  world.yaw_friction_scale = Vec2(1.1, 0.9);
  world.common.actual.body_mass = 1.0 + 0.01 * static_cast<double>(seed);  // robots differ
  return world;
}

MotorCommand command(std::mt19937& random) {
  std::uniform_real_distribution<double> duty(-0.6, 0.6);
  MotorCommand c{};
  c.enable = true;
  for (std::size_t i = 0; i < 3; ++i) c.duty[i] = duty(random);
  return c;
}

class By : public testing::TestWithParam<const char*> {};

/// Half a second of random duties: tilted, turning, sticking and sliding.
TEST_P(By, RobotsRollAsEachAlone) {
  const int count = 6;  // of eight places
  std::vector<MbbrWorld> alone;
  std::vector<MbbrWorld> together;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    alone.emplace_back(MbbrParameters{}, MotorParameters{}, Calibration{}, nominal(seed));
    together.emplace_back(MbbrParameters{}, MotorParameters{}, Calibration{}, nominal(seed));
  }
  std::mt19937 random(7);
  std::array<MbbrRollingOf<double>, count> numbers{};
  std::array<MbbrRollingOf<double>*, count> places{};
  for (std::size_t i = 0; i < count; ++i) places[i] = &numbers[i];
  for (int tick = 0; tick < 100; ++tick) {
    for (std::size_t i = 0; i < count; ++i) {
      const MotorCommand c = command(random);
      alone[i].advance(c);
      ASSERT_TRUE(together[i].begin_rolling(c, places[i]));
    }
    if (!roll_together_by(GetParam(), places.data(), count, together[0].bridge(),
                          together[0].steps_per_tick(), together[0].step_s()))
      GTEST_SKIP() << "this processor has no " << GetParam();
    for (std::size_t i = 0; i < count; ++i) {
      together[i].end_rolling(numbers[i]);
      const MbbrEstimate a = alone[i].truth();
      const MbbrEstimate b = together[i].truth();
      ASSERT_LT((a.theta_xy - b.theta_xy).norm(), 1e-9) << tick;
      ASSERT_LT((a.omega_B - b.omega_B).norm(), 1e-9) << tick;
      ASSERT_LT((a.phi_dot_star - b.phi_dot_star).norm(), 1e-9) << tick;
      ASSERT_LT((a.phi - b.phi).norm(), 1e-9) << tick;
      ASSERT_LT(std::abs(a.theta_z - b.theta_z), 1e-9) << tick;
      ASSERT_EQ(alone[i].time_s(), together[i].time_s());
      const RawSample x = alone[i].sense();
      const RawSample y = together[i].sense();
      for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(x.gyro_counts[k], y.gyro_counts[k], 1e-6);
      for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(x.encoder_counts[k], y.encoder_counts[k], 1e-6);
      ASSERT_NEAR(x.battery_counts, y.battery_counts, 1e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Isa, By, testing::Values("baseline", "avx2", "avx512"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace equipoise
