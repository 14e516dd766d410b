// Any command, suddenly: steps, reversals, full range and beyond, turning and driving at once. The governor
// makes each feasible, so nobody falls or is switched off. EQUIPOISE_COMMAND_SEQUENCES=1000: as many
// sequences.
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <random>

#include "app/cli/reasons.hpp"
#include "support/trial.hpp"

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

struct Trials {
  std::string controller;
  Range range;
  std::string fidelity = "nominal";
  std::vector<std::string> set{};
  bool governed = true;
};

/// The commands go through as they are, at up to the configured acceleration.
template <class Params>
void bypass_governor(Params& reference) {
  reference.max_jerk_m_s3 = std::numeric_limits<double>::infinity();
  reference.feasible_acceleration_m_s2 = std::numeric_limits<double>::infinity();
  reference.budget = DutyBudget{};
}

template <class Firmware>
int lost(const Trials& t) {
  const app::Choice choice{Firmware::kDefaultEstimator, t.controller, t.fidelity};
  auto config = Firmware::apply(Firmware::load(config_file<Firmware>(), t.set).config, choice);
  if (!t.governed) bypass_governor(config.reference);
  int count = 0;
  for (int seed = 1; seed <= sequences(); ++seed) {
    auto world = Firmware::world(config, app::fidelity_level(t.fidelity), static_cast<std::uint64_t>(seed));
    RandomPilot pilot(t.range, 1000U + static_cast<std::uint64_t>(seed));
    bool upright = true;
    std::uint32_t reasons = 0;
    Firmware::with_pipeline(config, t.controller, [&](auto& pipeline) {
      app::PlantBackend backend(world);
      app::Hardware hardware(backend.io());
      std::atomic<bool> done{false};
      const auto commands = [&](std::int64_t, std::int64_t) { return pilot.at(world.time_s()); };
      const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                               const auto& result) {
        upright = world.time_s() < 1.0 || result.arm_state == ArmState::kArmed;
        reasons = result.reasons;
        done = !upright || tick >= static_cast<std::int64_t>(30.0 * kTickHz);
      };
      (void)runtime::run_loop(hardware, pipeline, commands, on_tick, done);
    });
    if (upright) continue;
    ++count;
    std::printf("sequence %d: %s at %.2f s\n", seed, app::reasons_text(reasons).c_str(), world.time_s());
  }
  return count;
}

const Range kMbbrRange{0.6, 6.0 * kPi};
const Range kMipRange{0.8, 10.0};
const std::vector<std::string> kNoGripModel{"world.full.disturbance.wheel_grip=0.0"};

TEST(RandomCommands, NoneMakesTheMbbrFall) {
  EXPECT_EQ(lost<app::MbbrFirmware>({"scheduled", kMbbrRange}), 0);
}

TEST(RandomCommands, NoneMakesATypicalBuiltMbbrFall) {
  EXPECT_EQ(lost<app::MbbrFirmware>({"scheduled", kMbbrRange, "full", kNoGripModel}), 0);
}

TEST(RandomCommands, NoneMakesTheMipFallUnderSlc) {
  EXPECT_EQ(lost<app::MipFirmware>({"slc", kMipRange}), 0);
}

TEST(RandomCommands, NoneMakesTheMipFallUnderLqr) {
  EXPECT_EQ(lost<app::MipFirmware>({"lqr", kMipRange}), 0);
}

TEST(RandomCommands, NoneMakesATypicalBuiltMipFall) {
  EXPECT_EQ(lost<app::MipFirmware>({"slc", kMipRange, "full", kNoGripModel}), 0);
}

/// What the governor is for: ten times the acceleration, asked for by somebody who does not know the robot.
const std::vector<std::string> kImpatient{"reference.max_acceleration_m_s2=5.0"};

TEST(RandomCommands, AnImpatientPilotIsHeldBackByTheGovernor) {
  EXPECT_EQ(lost<app::MbbrFirmware>({"scheduled", kMbbrRange, "nominal", kImpatient}), 0);
  EXPECT_EQ(lost<app::MipFirmware>({"slc", kMipRange, "nominal", kImpatient}), 0);
}

TEST(RandomCommands, WithoutTheGovernorAnImpatientPilotMakesMostFall) {
  EXPECT_GT(lost<app::MbbrFirmware>({"scheduled", kMbbrRange, "nominal", kImpatient, false}),
            sequences() / 2);
  EXPECT_GT(lost<app::MipFirmware>({"slc", kMipRange, "nominal", kImpatient, false}), sequences() / 2);
}

}  // namespace
}  // namespace equipoise
