// Every reason against the motors is raised by production code: loop, supervisor, safety and what feeds them.
// A case breaks something in the world, at the hardware boundary or around the loop; none sets a bit or an
// age.
#include "app/text/reasons.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <thread>

#include "app/board/board.hpp"
#include "app/io/fault_backend.hpp"
#include "app/run/realtime_session.hpp"
#include "equipoise/runtime/command_receiver.hpp"
#include "equipoise/runtime/telemetry.hpp"
#include "robots/robots.hpp"
#include "support/trial.hpp"

namespace equipoise {
namespace {

constexpr std::int64_t kArmTick = 100;

struct Scene {
  std::vector<std::string> set{};
  std::string estimator{};
  std::function<void(RawSample&, std::int64_t tick)> spoil{};  // tick 0 is the first armed one
  std::vector<app::FaultKind> fault{};                         // at most one, from half a second after arming
  std::function<Command(std::int64_t tick, std::int64_t now_ns)> commands{};
  runtime::Watched watched{nullptr, 0, nullptr, true};
  runtime::Supervisor* supervisor = nullptr;  // instead of one for `watched`
  bool arm = true;
};

/// All reasons that were given in the trial's five seconds.
template <class Firmware>
std::uint32_t reasons_of(const Scene& scene) {
  app::Choice choice{scene.estimator, "", "nominal", false, ""};
  const auto robot = type_of<Firmware>().load(config_file<Firmware>(), scene.set);
  app::complete(*robot->type, &choice);
  const auto firmware = robot->firmware(choice);
  const auto world = robot->world(choice, 1);
  app::PlantBackend plant(*world);
  app::FaultBackend faulty(plant.io(), 1);
  app::Hardware hardware(faulty.io());
  runtime::Supervisor own(scene.watched);
  runtime::Supervisor& supervisor = scene.supervisor != nullptr ? *scene.supervisor : own;
  std::uint32_t seen = 0;
  std::int64_t ticks = 0;
  const std::atomic<bool> never{false};
  const auto spoil = [&](RawSample& raw) {
    if (scene.spoil) scene.spoil(raw, ticks - kArmTick);
  };
  const auto commands = [&](std::int64_t tick, std::int64_t now_ns) {
    if (scene.commands) return scene.commands(tick, now_ns);
    Command command;
    command.arm = scene.arm && tick >= kArmTick;
    return command;
  };
  const auto on_tick = [&](std::int64_t tick, std::int64_t, const RawSample&, const Command&, const auto& t) {
    if (!t.motors.enable && (tick > kArmTick || !scene.arm)) seen |= t.reasons;
    ticks = tick + 1;
    if (tick == kArmTick + 100 && !scene.fault.empty()) faulty.start(scene.fault[0], 1 << 20);
  };
  SteppedIo io(hardware, 1000, spoil);
  (void)runtime::run_loop(io, *firmware, commands, on_tick, never, supervisor);
  return seen;
}

std::uint32_t mbbr(const Scene& scene) { return reasons_of<MbbrFirmware>(scene); }
std::uint32_t mip(const Scene& scene) { return reasons_of<MipFirmware>(scene); }

std::uint32_t after(app::FaultKind fault) {
  Scene scene;
  scene.fault = {fault};
  return mbbr(scene);
}

std::uint32_t with_samples(std::function<void(RawSample&, std::int64_t)> spoil,
                           const std::vector<std::string>& set = {}) {
  Scene scene;
  scene.spoil = std::move(spoil);
  scene.set = set;
  return mbbr(scene);
}

/// Driven off right after arming: a wheel that has to turn shows at once what its encoder is worth.
std::uint32_t driven_off(std::function<void(RawSample&, std::int64_t)> spoil) {
  Scene scene;
  scene.set = {"reference.max_jerk_m_s3=3.0"};
  scene.spoil = std::move(spoil);
  scene.commands = [](std::int64_t tick, std::int64_t) {
    Command command;
    command.arm = tick >= kArmTick;
    command.velocity_W_m_s = Vec2(0.2, 0.1);
    command.yaw_rate_rad_s = 2.0;
    return command;
  };
  return mbbr(scene);
}

std::uint32_t reversed_encoder(std::size_t wheel) {
  return driven_off([wheel](RawSample& raw, std::int64_t) { raw.encoder_counts[wheel] *= -1.0; });
}

/// Upright in a fist: told to drive, but nothing moves.
std::uint32_t held_fast() {
  Scene scene;
  // Wheels and body that do not move together are a faulty IMU for the detector.
  scene.set = {"safety.encoder_check_drive=0.0", "safety.max_innovation=1000.0",
               "safety.max_motor_error=1000.0", "safety.detection=false"};
  scene.spoil = [first = RawSample{}](RawSample& raw, std::int64_t tick) mutable {
    if (tick < 0) {
      first = raw;
      return;
    }
    for (std::size_t i = 0; i < kMaxMotors; ++i) raw.encoder_counts[i] = first.encoder_counts[i];
    for (double& g : raw.gyro_counts) g = tick % 2 == 0 ? 0.5 : -0.5;
    raw.accel_counts[0] = static_cast<double>(tick % 3);
    raw.accel_counts[1] = 0.0;
    raw.accel_counts[2] = 4096.0;
  };
  scene.commands = [](std::int64_t tick, std::int64_t) {
    Command command;
    command.arm = tick >= kArmTick;
    if (command.arm) command.velocity_W_m_s.x() = 0.3;
    return command;
  };
  return mbbr(scene);
}

/// A wire on which nobody speaks.
class DeadWire final : public runtime::CommandWire {
 public:
  void listen(int, const Received&) override { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }
  void say(const std::vector<std::uint8_t>&) override {}
};

std::uint32_t silent_remote() {
  runtime::CommandReceiver receiver(runtime::CommandKeys::of_robot("robot", runtime::CommandKey({1, 2, 3})),
                                    {"robot", SafetyParams().command_timeout_s, nullptr},
                                    std::make_unique<DeadWire>());
  Scene scene;
  scene.commands = [&](std::int64_t tick, std::int64_t) {
    // The receiver's clock is the real one; the scene's runs ahead of it.
    if (tick == 1) std::this_thread::sleep_for(std::chrono::milliseconds(600));
    return receiver.latest();
  };
  return mbbr(scene);
}

/// The session that surrounds a run on the robot, without its guard process.
std::uint32_t session_reasons(const std::function<void(app::SessionOptions&)>& change,
                              const std::string& missing_calibration) {
  app::SessionOptions options;
  options.guard = false;
  options.realtime = false;
  change(options);
  app::RealtimeSession session(options, missing_calibration);
  const std::atomic<bool> log_failed{false};
  Scene scene;
  scene.supervisor = &session.begin(log_failed);
  const std::uint32_t seen = mbbr(scene);
  session.end();
  return seen;
}

std::uint32_t board_without_calibration() {
  const std::string path = std::string(EQUIPOISE_SOURCE_DIR) + "/config/boards/robotics_cape_mbbr.toml";
  const app::Board board = app::load_board(path);
  EXPECT_TRUE(board.calibration_file.empty());  // as shipped
  return session_reasons([](app::SessionOptions&) {}, app::missing_calibration(board));
}

std::uint32_t no_realtime() {
  return session_reasons(
      [](app::SessionOptions& options) {
        options.realtime = true;
        options.cpu = 4096;  // none has so many
      },
      "");
}

std::uint32_t silent_guard() {
  runtime::HeartbeatPage page{};
  Scene scene;
  scene.watched.page = &page;
  return mbbr(scene);
}

/// A real log on a device that is always full.
std::uint32_t full_disk() {
  runtime::TelemetryOptions options;
  options.log_path = "/dev/full";
  runtime::Telemetry telemetry(options);
  const runtime::TickRecord record{};
  for (int i = 0; i < 10000 && !telemetry.log_failed(); ++i) {
    telemetry.hand_over(record);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  Scene scene;
  scene.watched.log_failed = &telemetry.log_failed();
  return mbbr(scene);
}

const std::map<std::uint32_t, std::function<std::uint32_t()>> kCauses{
    {kNotRequested,
     [] {
       Scene scene;
       scene.arm = false;
       return mbbr(scene);
     }},
    {kTilt, [] { return mbbr({{"world.nominal.initial_tilt_rad=0.3"}}); }},
    {kImuStale, [] { return after(app::FaultKind::kImuOff); }},
    {kEncoderStale,
     [] {
       return with_samples([](RawSample& raw, std::int64_t tick) {
         if (tick > 100) raw.valid &= ~static_cast<unsigned>(RIO_ENCODERS);
       });
     }},
    {kNotFinite,
     [] {
       Scene scene;
       scene.commands = [](std::int64_t tick, std::int64_t) {
         Command command;
         command.arm = tick >= kArmTick;
         if (tick > kArmTick + 100) command.yaw_rate_rad_s = NAN;
         return command;
       };
       return mbbr(scene);
     }},
    {kBatteryLow, [] { return after(app::FaultKind::kBatterySag); }},
    {kAttitudeStale,
     [] {
       Scene scene;
       scene.estimator = "kf_attitude";
       scene.fault = {app::FaultKind::kTornPacket};
       return mbbr(scene);
     }},
    {kGyroMoving,
     [] {
       return with_samples([](RawSample& raw, std::int64_t tick) {
         raw.gyro_counts[2] += 150.0 * 16.4 * (tick % 2 == 0 ? 1.0 : 1.01);  // turned by hand, 2.6 rad/s
       });
     }},
    {kNotCalibrated, board_without_calibration},
    {kEncoderSign, [] { return reversed_encoder(0); }},
    {kEstimatorUnhealthy,
     [] {
       return with_samples(
           [](RawSample& raw, std::int64_t tick) {
             if (tick > 100) raw.accel_counts[0] += 4096.0 * (tick % 2 == 0 ? 1.0 : -1.0);
           },
           {"safety.max_innovation=4.0", "safety.max_innovation_s=0.15"});
     }},
    {kCommandStale, silent_remote},
    {kRealtimeMissing, no_realtime},
    {kGuardDead, silent_guard},
    {kOverrun,
     [] {
       Scene scene;
       scene.fault = {app::FaultKind::kStall50ms};
       scene.set = {"safety.max_stalled_ticks=5"};
       return mbbr(scene);
     }},
    // Nothing judged: the detector may be first.
    {kPickedUp,
     [] {
       return mip({{"world.nominal.lift_at_s=3.0", "safety.detection=false"}});
     }},
    {kStall, held_fast},
    {kEncoderJump,
     [] {
       return with_samples([](RawSample& raw, std::int64_t tick) {
         if (tick > 100) raw.encoder_counts[0] += 500.0 * static_cast<double>(tick % 2);
       });
     }},
    {kBridgeFault,
     [] {
       return with_samples([](RawSample& raw, std::int64_t tick) {
         if (tick > 100) raw.health |= RIO_BRIDGE_FAULT;
       });
     }},
    {kWriteFailed, [] { return after(app::FaultKind::kWriteError); }},
    {kLogFailed, full_disk},
    {kEncoderStuck,
     [] {
       return driven_off(
           [](RawSample& raw, std::int64_t) { raw.encoder_counts[0] = raw.encoder_counts[1] = 17.0; });
     }},
    {kImuUntrusted, [] { return after(app::FaultKind::kGyroXFrozen); }},
    {kMotorFault, [] { return after(app::FaultKind::kMotorStuck); }},
    {kWheelOne, [] { return reversed_encoder(0); }},
    {kWheelTwo, [] { return reversed_encoder(1); }},
    {kWheelThree, [] { return reversed_encoder(2); }},
    {kWheelFour,
     [] {
       Scene scene;
       scene.spoil = [](RawSample& raw, std::int64_t) { raw.encoder_counts[3] *= -1.0; };
       return reasons_of<CartPendulumFirmware>(scene);
     }},
};

class Reason : public testing::TestWithParam<std::uint32_t> {};

TEST_P(Reason, IsRaisedByProductionCode) {
  const std::uint32_t bit = 1U << GetParam();
  if (bit == kWheelSlip || bit == kSaturated) GTEST_SKIP() << "of logs that are older than this firmware";
  ASSERT_EQ(kCauses.count(bit), 1U) << "a reason without a case";
  const std::uint32_t seen = kCauses.at(bit)();
  EXPECT_NE(seen & bit, 0U) << "seen: " << app::reasons_text(seen);
}

INSTANTIATE_TEST_SUITE_P(Every, Reason,
                         testing::Range(0U, static_cast<std::uint32_t>(app::safety_reasons().size())),
                         [](const auto& test) {
                           return std::string(app::safety_reasons()[test.param].name);
                         });

TEST(Reasons, ASoundRobotHasNone) {
  EXPECT_EQ(mbbr({}), 0U);
  EXPECT_EQ(mip({}), 0U);
}

}  // namespace
}  // namespace equipoise
