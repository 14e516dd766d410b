// Robot N is the same on every machine, and lies in its ranges.
#include "config/population.hpp"

#include <gtest/gtest.h>

#include <set>

#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"

namespace equipoise {
namespace {

const std::string kMbbrFile = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";

double value_of(const std::vector<config::Drawn>& drawn, const std::string& key, std::size_t i = 0) {
  for (const config::Drawn& d : drawn) {
    if (d.key == key) return d.values.at(i);
  }
  ADD_FAILURE() << key << " was not drawn";
  return 0.0;
}

TEST(Population, DrawsAreFixedFormulas) {
  // Computed apart, in Python: FNV-1a of the key, splitmix64, 53 bits.
  EXPECT_DOUBLE_EQ(config::unit_draw(1, "battery_V", 0), 0.7365765516111267);
  EXPECT_DOUBLE_EQ(config::unit_draw(7, "disturbance.static_ratio", 2), 0.2678964785983349);
  double mean = 0.0;
  double square = 0.0;
  for (int robot = 1; robot <= 2000; ++robot) {
    const double x = config::normal_draw(robot, "a", 0);
    mean += x / 2000.0;
    square += x * x / 2000.0;
  }
  EXPECT_NEAR(mean, 0.0, 0.08);
  EXPECT_NEAR(square, 1.0, 0.1);
}

TEST(Population, RobotsDifferAndLieInTheirRanges) {
  std::set<double> seen;
  double highest = 0.0;
  double lowest = 10.0;
  for (int robot = 1; robot <= 100; ++robot) {
    const auto drawn = config::draw_robot(kMbbrFile, {}, "full", robot);
    const double ratio = value_of(drawn, "disturbance.static_ratio");
    seen.insert(ratio);
    highest = std::max(highest, ratio);
    lowest = std::min(lowest, ratio);
    EXPECT_NE(value_of(drawn, "disturbance.wheel_torque_scale", 0),
              value_of(drawn, "disturbance.wheel_torque_scale", 2));
  }
  EXPECT_EQ(seen.size(), 100U);
  EXPECT_GE(lowest, 1.0);
  EXPECT_LT(lowest, 1.05);
  EXPECT_LE(highest, 1.5);
  EXPECT_GT(highest, 1.45);
}

TEST(Population, TheWorldIsTheDrawnRobotAndTheFirmwareIsNot) {
  const auto drawn = config::draw_robot(kMbbrFile, {}, "full", 3);
  const MbbrConfig c =
      load_mbbr(kMbbrFile, config::with_robot_drawn(drawn, "full", {"world.full.battery_V=7.77"})).config;
  const MbbrConfig plain = load_mbbr(kMbbrFile, {}).config;
  const auto full = static_cast<std::size_t>(Fidelity::kFull);
  EXPECT_EQ(c.world[full].common.stiction.static_ratio, value_of(drawn, "disturbance.static_ratio"));
  EXPECT_EQ(c.world[full].common.actual.body_mass, value_of(drawn, "actual.body_mass_scale"));
  EXPECT_EQ(c.world[full].common.imu_misalignment_rad.y(),
            value_of(drawn, "disturbance.imu_misalignment_rad", 1));
  EXPECT_EQ(c.world[full].common.battery_V, 7.77);  // what is asked for has the last word
  EXPECT_EQ(c.robot.m_t, plain.robot.m_t);
  EXPECT_TRUE(config::draw_robot(kMbbrFile, {}, "full", 0).empty());
}

TEST(Population, RefusesAKeyThatTheWorldLacksAndAnEmptyRange) {
  EXPECT_THROW(config::draw_robot(kMbbrFile, {}, "thesis", 1), ConfigError);  // no disturbances there
  EXPECT_THROW(config::draw_robot(kMbbrFile, {"population.battery_V=[8.0, 7.0]"}, "full", 1), ConfigError);
  EXPECT_THROW(config::draw_robot(kMbbrFile, {"population.battery_V={sigma=-1.0}"}, "full", 1), ConfigError);
}

}  // namespace
}  // namespace equipoise
