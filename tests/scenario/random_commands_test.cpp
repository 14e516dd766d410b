// Any allowed command, suddenly: steps, reversals, full range, turning and driving at once. The governor
// makes each feasible, so nobody falls. EQUIPOISE_COMMAND_SEQUENCES=1000 runs as many sequences per robot.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "app/io/plant_backend.hpp"
#include "app/run/firmware.hpp"
#include "equipoise/runtime/loop.hpp"

namespace equipoise {
namespace {

int sequences() {
  const char* text = std::getenv("EQUIPOISE_COMMAND_SEQUENCES");
  return text != nullptr ? std::atoi(text) : 20;
}

struct Range {
  double speed_m_s;
  double yaw_rate_rad_s;
};

/// Holds each command for 0.1 to 3 s; a third of them at the ends of the range.
class RandomPilot {
 public:
  RandomPilot(const Range& range, std::uint64_t seed) : range_(range), random_(seed) {}

  Command at(double time_s) {
    command_.arm = time_s >= 0.5;
    if (time_s >= next_s_) {
      next_s_ = time_s + 0.1 + 2.9 * uniform();
      const double direction = 2.0 * kPi * uniform();
      command_.velocity_W_m_s = amount() * range_.speed_m_s * Vec2(std::cos(direction), std::sin(direction));
      command_.yaw_rate_rad_s = (uniform() < 0.5 ? -1.0 : 1.0) * amount() * range_.yaw_rate_rad_s;
    }
    return command_;
  }

 private:
  double uniform() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }
  double amount() {
    const double kind = uniform();
    return kind < 1.0 / 3.0 ? 1.0 : kind < 0.45 ? 0.0 : uniform();
  }

  Range range_;
  std::mt19937_64 random_;
  Command command_;
  double next_s_ = 1.5;
};

template <class Firmware>
int falls(const typename Firmware::Config& configured, const std::string& controller, const Range& range) {
  app::Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = controller;
  choice.fidelity = "nominal";
  const auto config = Firmware::apply(configured, choice);
  int fallen = 0;
  for (int seed = 1; seed <= sequences(); ++seed) {
    auto world =
        Firmware::world(config, app::fidelity_level(choice.fidelity), static_cast<std::uint64_t>(seed));
    RandomPilot pilot(range, 1000U + static_cast<std::uint64_t>(seed));
    bool upright = true;
    Firmware::with_pipeline(config, choice.controller, [&](auto& pipeline) {
      app::PlantBackend backend(world);
      app::Hardware hardware(backend.io());
      std::atomic<bool> done{false};
      const auto commands = [&](std::int64_t, std::int64_t) { return pilot.at(world.time_s()); };
      const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                               const auto& t) {
        upright = upright && (world.time_s() < 1.0 || t.arm_state == ArmState::kArmed);
        if (!upright || tick >= static_cast<std::int64_t>(30.0 * kTickHz)) done = true;
      };
      (void)runtime::run_loop(hardware, pipeline, commands, on_tick, done);
    });
    if (!upright) {
      ++fallen;
      std::printf("sequence %d fell at %.2f s\n", seed, world.time_s());
    }
  }
  return fallen;
}

TEST(RandomCommands, NoneMakesTheMbbrFall) {
  const auto config = load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config;
  EXPECT_EQ(falls<app::MbbrFirmware>(config, "scheduled", {0.6, 6.0 * kPi}), 0);
}

TEST(RandomCommands, NoneMakesTheMipFallUnderEitherController) {
  const auto config = load_mip(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml", {}).config;
  for (const char* controller : {"slc", "lqr"}) {
    EXPECT_EQ(falls<app::MipFirmware>(config, controller, {0.8, 10.0}), 0) << controller;
  }
}

}  // namespace
}  // namespace equipoise
