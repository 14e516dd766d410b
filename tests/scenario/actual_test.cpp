// Issue: a robot unlike its model. Scales of the plant alone, one at a time and all at once, driven at 1 Hz
// and 0.1 m/s in the nominal world. EQUIPOISE_ACTUAL_DRAWS=50 draws fifty robots instead of five.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "app/sim/simulate.hpp"
#include "config/population.hpp"

namespace equipoise {
namespace {

struct Scale {
  const char* key;
  double most;
};
constexpr std::array<Scale, 8> kScales{{{"body_mass_scale", 0.20},
                                        {"com_height_scale", 0.20},
                                        {"body_inertia_scale", 0.20},
                                        {"ball_mass_scale", 0.20},
                                        {"ball_radius_scale", 0.05},
                                        {"wheel_radius_scale", 0.05},
                                        {"torque_scale", 0.20},
                                        {"back_emf_scale", 0.20}}};

std::string set(const Scale& scale, double value) {
  return std::string("world.nominal.actual.") + scale.key + "=" + std::to_string(value);
}

app::SimSummary drive(const std::vector<std::string>& overrides, std::uint64_t seed) {
  const std::string path = std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
  app::Choice choice;
  choice.fidelity = "nominal";
  app::SimOptions options;
  options.script.yaw_rate_rad_s = 2.0 * kPi;
  options.script.drive_mps = 0.1;
  options.duration_s = 30.0;
  options.seed = seed;
  const std::atomic<bool> stop{false};
  const auto robot = app::load_robot(path, overrides);
  app::complete(*robot->type, &choice);
  return app::simulate(*robot, choice, options, {}, stop);
}

TEST(ActualRobot, StaysUprightWithEachScaleAtItsEnds) {
  for (const Scale& scale : kScales) {
    for (const double sign : {-1.0, 1.0}) {
      EXPECT_FALSE(drive({set(scale, 1.0 + sign * scale.most)}, 1).verdict.fell())
          << scale.key << " " << sign;
    }
  }
}

TEST(ActualRobot, StaysUprightWithAllScalesDrawnAtOnce) {
  const char* const asked = std::getenv("EQUIPOISE_ACTUAL_DRAWS");
  const int draws = asked != nullptr ? std::atoi(asked) : 5;
  ASSERT_GT(draws, 0);
  for (int robot = 1; robot <= draws; ++robot) {
    std::vector<std::string> overrides;
    for (const Scale& scale : kScales) {
      const double x = 2.0 * config::unit_draw(robot, scale.key, 0) - 1.0;
      overrides.push_back(set(scale, 1.0 + x * scale.most));
    }
    const app::SimSummary s = drive(overrides, static_cast<std::uint64_t>(robot));
    std::string which;
    for (const std::string& text : overrides) which += text + " ";
    EXPECT_FALSE(s.verdict.fell()) << "robot " << robot << ": " << s.verdict.sentence() << " " << which;
  }
}

}  // namespace
}  // namespace equipoise
