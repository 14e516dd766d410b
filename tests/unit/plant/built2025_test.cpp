// The world `built2025` is what `full` was at 9a53cde: the same robot, seed and duty give the same counts.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "config/population.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mbbr/world.hpp"
#include "robots/mip/config.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {
namespace {

struct Recorded {
  std::int64_t robot;
  std::uint64_t seed;
  std::array<double, 3> gyro, accel, encoder;
  double battery;
};

/// One second under a duty that wanders slowly; held for the first ten ticks.
template <class World>
RawSample after_a_second(World world) {
  RawSample raw{};
  for (int tick = 0; tick < 200; ++tick) {
    raw = world.sense();
    MotorCommand command{};
    command.enable = tick >= 10;
    for (int k = 0; k < 3; ++k) command.duty[k] = command.enable ? 0.3 * std::sin(0.05 * tick + k) : 0.0;
    world.advance(command);
  }
  return raw;
}

template <class World, class Load>
void expect_as_recorded(const char* file, const Load& load, const std::vector<Recorded>& rows) {
  const std::string path = std::string(EQUIPOISE_SOURCE_DIR) + "/config/" + file;
  const char* const name = "built2025";
  for (const Recorded& row : rows) {
    const auto drawn = config::draw_robot(path, {}, name, row.robot);
    auto c = load(path, config::with_robot_drawn(drawn, name, {})).config;
    const auto i = static_cast<std::size_t>(Fidelity::kBuilt2025);
    c.world[i].common.seed = row.seed;
    c.motor.bridge = c.world_bridge[i];
    const RawSample raw = after_a_second(World(c.robot, c.motor, c.calibration, c.world[i]));
    SCOPED_TRACE(row.robot);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(raw.gyro_counts[k], row.gyro[k], 2.0);
      EXPECT_NEAR(raw.accel_counts[k], row.accel[k], 2.0);
      EXPECT_NEAR(raw.encoder_counts[k], row.encoder[k], 1.0);
    }
    EXPECT_NEAR(raw.battery_counts, row.battery, 1.0);
  }
}

TEST(Built2025, MbbrIsWhatFullWas) {
  expect_as_recorded<MbbrWorld>("mbbr.toml", [](auto&&... a) { return load_mbbr(a...); },
                                {{0, 1, {12005, -1023, -74}, {288, -323, -6652}, {-376, 23, 345}, 1583},
                                 {3, 1, {5379, 738, 50}, {271, -239, -1549}, {-255, 18, 233}, 1656},
                                 {77, 5, {18807, -3908, 888}, {-427, -1461, -25199}, {-207, 34, 169}, 1655}});
}

/// But for the side force of rolling, which its plant has had since.
TEST(Built2025, EdumipIsWhatFullWas) {
  expect_as_recorded<MipWorld>("edumip.toml", [](auto&&... a) { return load_mip(a...); },
                               {{0, 1, {4803, 2198, -1695}, {511, 2950, -1407}, {341, 209, 0}, 1551},
                                {3, 1, {9362, 406, -2320}, {693, 267, -1519}, {319, 286, 0}, 1639},
                                {77, 5, {9767, 476, -2926}, {653, 104, -1178}, {286, 245, 0}, 1649}});
}

}  // namespace
}  // namespace equipoise
