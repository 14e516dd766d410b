// Any command, suddenly: steps, reversals, full range, turning and driving at once. The governor makes each
// feasible, so that no robot falls or is switched off. EQUIPOISE_COMMAND_SEQUENCES=1000: as many sequences;
// EQUIPOISE_FIRST_SEQUENCE=1001: others than the first.
#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <random>

#include "app/evaluate/parallel.hpp"
#include "app/text/reasons.hpp"
#include "support/trial.hpp"

namespace equipoise {
namespace {

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atoi(text) : otherwise;
}

int sequences() { return from_environment("EQUIPOISE_COMMAND_SEQUENCES", 20); }

struct Range {
  double speed_m_s;
  double yaw_rate_rad_s;
};

/// Holds each command for 0.1 to 3 s; a third of them at the ends of the range.
class RandomPilot {
 public:
  /// `by_hand`: moves a stick to its commands, half a second each, and tells them fifty times a second.
  RandomPilot(const Range& range, std::uint64_t seed, bool by_hand)
      : range_(range), random_(seed), by_hand_(by_hand) {}

  Command at(double time_s) {
    command_.arm = time_s >= 0.5;
    if (time_s >= next_s_) {
      next_s_ = time_s + 0.1 + 2.9 * uniform();
      const double direction = 2.0 * kPi * uniform();
      command_.velocity_W_m_s = amount() * range_.speed_m_s * Vec2(std::cos(direction), std::sin(direction));
      command_.yaw_rate_rad_s = (uniform() < 0.5 ? -1.0 : 1.0) * amount() * range_.yaw_rate_rad_s;
    }
    if (!by_hand_) return command_;
    if (time_s >= next_told_s_) {
      constexpr double kTold_s = 0.02;
      constexpr double kHand_s = 0.5;
      next_told_s_ = time_s + kTold_s;
      told_.velocity_W_m_s += kTold_s / kHand_s * (command_.velocity_W_m_s - told_.velocity_W_m_s);
      told_.yaw_rate_rad_s += kTold_s / kHand_s * (command_.yaw_rate_rad_s - told_.yaw_rate_rad_s);
    }
    told_.arm = command_.arm;
    return told_;
  }

 private:
  double uniform() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }
  double amount() {
    const double kind = uniform();
    return kind < 1.0 / 3.0 ? 1.0 : kind < 0.45 ? 0.0 : uniform();
  }

  Range range_;
  std::mt19937_64 random_;
  bool by_hand_;
  Command command_, told_;
  double next_s_ = 1.5;
  double next_told_s_ = 0.0;
};

struct Trials {
  std::string controller;
  Range range;
  std::vector<std::string> set{};
  bool governed = true;
  int times = 1;  // as many sequences
  bool by_hand = false;
};

/// Slew limits as they were before there was a governor, and nothing else of it.
template <class Params>
void bypass_governor(Params& reference) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  reference.max_acceleration_m_s2 = 0.5;
  reference.max_jerk_m_s3 = reference.feasible_acceleration_m_s2 = kNone;
  if constexpr (std::is_same_v<Params, MbbrReferenceParams>) reference.floor_yaw_acceleration_rad_s2 = kNone;
  reference.budget = DutyBudget{};
}

/// When and why the motors went off, or had been at their limit for half a second; empty: never.
template <class Firmware, class Config>
std::string loss(const Config& config, const Trials& t, std::uint64_t seed) {
  auto world = Firmware::world(config, app::fidelity_level("built2025"), seed);
  RandomPilot pilot(t.range, 1000U + seed, t.by_hand);
  return Firmware::with_pipeline(config, t.controller, [&](auto& pipeline) {
    app::PlantBackend backend(world);
    app::Hardware hardware(backend.io());
    std::string why;
    int at_limit = 0;  // ticks without a break
    std::atomic<bool> done{false};
    const auto commands = [&](std::int64_t, std::int64_t) { return pilot.at(world.time_s()); };
    const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&,
                             const auto& result) {
      if (world.time_s() > 1.0 && result.arm_state != ArmState::kArmed)
        why = app::reasons_text(result.reasons) + " at " + std::to_string(world.time_s()) + " s";
      at_limit = result.saturated ? at_limit + 1 : 0;
      if (at_limit > 100) why = "at its limit at " + std::to_string(world.time_s()) + " s";
      done = !why.empty() || tick >= static_cast<std::int64_t>(30.0 * kTickHz);
    };
    (void)runtime::run_loop(hardware, pipeline, commands, on_tick, done);
    return why;
  });
}

template <class Firmware>
int lost(const Trials& t) {
  const app::Choice choice{Firmware::kDefaultEstimator, t.controller, "built2025"};
  auto config = Firmware::apply(Firmware::load(config_file<Firmware>(), t.set).config, choice);
  if (!t.governed) bypass_governor(config.reference);
  const auto first = static_cast<std::uint64_t>(from_environment("EQUIPOISE_FIRST_SEQUENCE", 1));
  std::vector<std::string> losses(static_cast<std::size_t>(t.times * sequences()));
  app::in_parallel("random commands", losses.size(), app::threads_for(0),
                   [&](std::size_t i) { losses[i] = loss<Firmware>(config, t, first + i); });
  int count = 0;
  for (std::size_t i = 0; i < losses.size(); ++i) {
    if (losses[i].empty()) continue;
    ++count;
    if (t.governed) std::printf("sequence %zu: %s\n", static_cast<std::size_t>(first) + i, losses[i].c_str());
  }
  std::printf("%d of %d lost\n", count, t.times * sequences());
  return count;
}

const Range kMbbrRange{0.6, 6.0 * kPi};
const Range kMipRange{0.8, 10.0};

TEST(RandomCommands, NoneMakesTheMbbrFall) { EXPECT_EQ(lost<MbbrFirmware>({"scheduled", kMbbrRange}), 0); }

TEST(RandomCommands, NoneByHandMakesARobotFall) {
  Trials mbbr{"scheduled", kMbbrRange};
  Trials mip{"slc", kMipRange};
  mbbr.by_hand = mip.by_hand = true;
  EXPECT_EQ(lost<MbbrFirmware>(mbbr), 0);
  EXPECT_EQ(lost<MipFirmware>(mip), 0);
}

/// Of one sequence of the MBBR.
std::string mbbr_loss(std::uint64_t sequence) {
  const app::Choice choice{MbbrFirmware::kDefaultEstimator, "scheduled", "built2025"};
  const auto config = MbbrFirmware::apply(MbbrFirmware::load(config_file<MbbrFirmware>(), {}).config, choice);
  return loss<MbbrFirmware>(config, {"scheduled", kMbbrRange}, sequence);
}

/// All wheels held by stiction, it tips over its rolling ball as one piece: no encoder is dead.
TEST(RandomCommands, AHeldRobotThatTipsHasNoDeadEncoder) { EXPECT_EQ(mbbr_loss(994), ""); }

/// It turns and drives so that two wheels stand still: their encoders are not dead.
TEST(RandomCommands, WheelsThatATurnLeavesStillAreNotDead) { EXPECT_EQ(mbbr_loss(1227), ""); }

/// A sound encoder was left out 23 s before: no sign of a swapped gyro.
TEST(RandomCommands, AnEncoderLeftOutLongAgoDoesNotAccuseTheGyro) { EXPECT_EQ(mbbr_loss(2321), ""); }

TEST(RandomCommands, NoneMakesTheMipFallUnderSlc) { EXPECT_EQ(lost<MipFirmware>({"slc", kMipRange}), 0); }

TEST(RandomCommands, NoneMakesTheMipFallUnderLqr) { EXPECT_EQ(lost<MipFirmware>({"lqr", kMipRange}), 0); }

/// A configuration that asks for ten times the acceleration is held back to the lean that torque can bring
/// back.
TEST(RandomCommands, AnImpatientConfigurationIsHeldBack) {
  const std::vector<std::string> impatient{"reference.max_acceleration_m_s2=5.0"};
  EXPECT_EQ(lost<MbbrFirmware>({"scheduled", kMbbrRange, impatient}), 0);
}

/// The eduMIP's motors can do what slew limits alone ask of it, the MBBR's if its bridges give more than
/// asked.
TEST(RandomCommands, WithoutTheGovernorSomeAreLost) {
  EXPECT_GT(lost<MbbrFirmware>({"scheduled", kMbbrRange, {"motor.bridge_lost_s=0"}, false, 4}), 0);
}

}  // namespace
}  // namespace equipoise
