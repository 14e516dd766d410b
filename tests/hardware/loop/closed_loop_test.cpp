// The production pipeline on the board's drivers balances the simulated robot through I2C, decoders, PWM and
// GPIO of a real kernel, and whatever breaks, the motors are off within three ticks of robot time, seen from
// the pins.
#include "closed_loop.hpp"

#include <bbb.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <equipoise/runtime/loop.hpp>
#include <new>
#include <optional>

#include "app/hardware.hpp"

using namespace equipoise;

namespace {
constexpr int kTicksPerSecond = 200;
constexpr int kToBalance = 3 * kTicksPerSecond;

std::atomic<bool> stop{false};
void onSignal(int) { stop = true; }

// The firmware's process: exactly what `run` does, arming as soon as the safety gate lets it.
int firmware(const MbbrConfig& config, std::atomic<std::uint32_t>* ticks) {
  signal(SIGTERM, onSignal);
  const bbb_config_t board = Bench::mbbr();
  bbb_error_t error{};
  rio_t io{};
  if (bbb_open(&board, &io, &error) != 0) {
    std::fprintf(stderr, "firmware: %s\n", error.text);
    return 1;
  }
  app::Hardware hardware(io);
  MbbrScheduledPipeline pipeline(config.scheduled_pipeline());
  const auto command = [](std::int64_t tick, std::int64_t) {
    Command c;
    c.arm = tick > kTicksPerSecond / 2;
    return c;
  };
  const auto observe = [ticks](auto&&...) { ++*ticks; };
  runtime::run_loop(hardware, pipeline, command, observe, stop);
  return 0;
}

class ClosedLoop : public ::testing::Test {
 protected:
  void SetUp() override {
    config_ = load_mbbr("/mnt/config/mbbr.toml", {}).config;
    void* shared = mmap(nullptr, sizeof *ticks_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(shared, MAP_FAILED);
    ticks_ = new (shared) std::atomic<std::uint32_t>(0);
    world_.emplace(bench_, config_, 1, *ticks_);
    child_ = fork();
    if (child_ == 0) _exit(firmware(config_, ticks_));
  }
  void TearDown() override {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    munmap(ticks_, sizeof *ticks_);
  }
  // Until it stands by itself.
  void balance(int ticks) {
    while (*ticks_ == 0) {
      ASSERT_EQ(waitpid(child_, nullptr, WNOHANG), 0) << "the firmware did not start";
      world_->tick();
    }
    for (int i = 0; i < ticks; ++i) {
      ASSERT_TRUE(world_->tick()) << "no answer in tick " << i;
      ASSERT_LT(world_->tilt_rad(), 0.5) << "fell in tick " << i;
    }
    ASSERT_FALSE(world_->held()) << "never armed";
    ASSERT_FALSE(world_->motorsOff());
  }
  int ticksUntilOff(bool data_ready = true) {
    for (int i = 0; i <= 10; ++i) {
      if (world_->motorsOff()) return i;
      world_->tick(data_ready);
    }
    return 99;
  }

  Bench bench_;
  MbbrConfig config_;
  std::atomic<std::uint32_t>* ticks_ = nullptr;
  std::optional<PinWorld> world_;
  pid_t child_ = -1;
};
}  // namespace

TEST_F(ClosedLoop, StaysUprightForTwentySecondsAndCoastsOnSigterm) {
  balance(20 * kTicksPerSecond);
  kill(child_, SIGTERM);
  int status = -1;
  for (int i = 0; i < 3 && waitpid(child_, &status, WNOHANG) == 0; ++i) world_->tick();
  if (status == -1) waitpid(child_, &status, 0);
  child_ = -1;
  EXPECT_EQ(status, 0);
  EXPECT_TRUE(world_->motorsOff());
}

TEST_F(ClosedLoop, CoastsWithinThreeTicksOfAnI2cUnplug) {
  balance(kToBalance);
  bench_.fault("imu", EREMOTEIO, UINT32_MAX);
  EXPECT_LE(ticksUntilOff(), 3);
}

TEST_F(ClosedLoop, CoastsWithinThreeTicksOfALostInterrupt) {
  balance(kToBalance);
  EXPECT_LE(ticksUntilOff(false), 3);
}

TEST_F(ClosedLoop, CoastsWithinThreeTicksOfALostDecoder) {
  balance(kToBalance);
  bench_.fault("counter", ENODEV, UINT32_MAX);
  EXPECT_LE(ticksUntilOff(), 3);
}
