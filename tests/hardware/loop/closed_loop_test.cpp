// The unmodified firmware, `equipoise run`, balances simulated robots through I2C, decoders, PWM and GPIO of
// a real kernel, each wired by its own board file. Whatever breaks, the motors are off, seen from the pins,
// within three ticks: of the break where the break is what the firmware sees, of the last tick that the
// estimator may bridge where samples are missing, of its judgement where it has to be inferred.
#include "closed_loop.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>

#include "app/log/run_log.hpp"
#include "equipoise/actuate/degraded.hpp"
#include "equipoise/actuate/safety.hpp"
#include "syscall_trace.hpp"

using namespace equipoise;

void PrintTo(const PinRobot& robot, std::ostream* out) { *out << robot.name; }

namespace {
constexpr int kTicksPerSecond = 200;
constexpr int kToBalance = 3 * kTicksPerSecond;
constexpr int kToStart = 60 * kTicksPerSecond;        // loading over 9p stops this machine's clock for nobody
constexpr int kToFindEncoder = 10 * kTicksPerSecond;  // by a robot that hardly moves
constexpr std::int64_t kThreeTicks_ns = 15'000'000;
constexpr const char* kLog = "/tmp/run.lcm";

// The world does not wait for anybody: above guard and loop.
void becomeTheWorld() {
  sched_param priority{};
  priority.sched_priority = 95;
  ASSERT_EQ(sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority), 0);
  ASSERT_EQ(mlockall(MCL_CURRENT | MCL_FUTURE), 0);
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);  // the guard of a killed firmware becomes our child
}

// Until the kernel kills it.
[[noreturn]] void takeAllMemory() {
  std::ofstream("/proc/self/oom_score_adj") << 1000;
  constexpr std::size_t kPiece = std::size_t{1} << 20U;
  for (;;) {
    void* piece = mmap(nullptr, kPiece, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (piece != MAP_FAILED) std::memset(piece, 1, kPiece);
  }
}

class ClosedLoop : public ::testing::TestWithParam<PinRobot> {
 protected:
  void SetUp() override {
    becomeTheWorld();
    world_.emplace(bench_, GetParam(), 1);
    const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
    const std::string program = here / "../../equipoise";
    child_ = fork();
    if (child_ == 0) {
      const PinRobot& robot = world_->robot();
      execl(program.c_str(), "equipoise", "run", "--config", robot.config.c_str(), "--board",
            robot.board.c_str(), "--arm", "--without-calibration", "--telemetry", "off", "--log", kLog,
            nullptr);
      _exit(127);
    }
  }
  void TearDown() override {
    if (child_ > 0) kill(child_, SIGKILL);
    // Nobody is left, not even the guard.
    for (int i = 0; i < kTicksPerSecond && waitpid(-1, nullptr, WNOHANG) >= 0; ++i) world_->advance();
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a process outlived its robot";
    EXPECT_TRUE(world_->motorsOff());
  }
  // Until the motors come on for the first time.
  void waitUntilArmed() {
    for (int i = 0; i < kToStart && world_->held(); ++i) {
      ASSERT_EQ(waitpid(child_, nullptr, WNOHANG), 0) << "the firmware did not start";
      world_->advance();
    }
    ASSERT_FALSE(world_->held()) << "never armed";
  }
  // It stands by itself.
  void balance(int ticks) {
    waitUntilArmed();
    for (int i = 0; i < ticks; ++i) {
      world_->advance();
      ASSERT_LT(world_->tilt_rad(), 0.5) << "fell in tick " << i;
      ASSERT_FALSE(world_->motorsOff()) << "gave up in tick " << i;
    }
  }
  void stickEncoder(std::size_t wheel) { bench_.stickCounter(GetParam().wheels[wheel].decoder); }
  // 0: they are off already.
  int ticksUntilOff(int at_most = 10, bool data_ready = true) {
    int ticks = 0;
    while (ticks < at_most && !world_->motorsOff()) {
      world_->advance(data_ready);
      ++ticks;
    }
    EXPECT_EQ(world_->late(), 0) << "the world lost ticks";
    return world_->motorsOff() ? ticks : 9999;
  }
  // Asked to end; its exit status.
  int terminated() {
    kill(child_, SIGTERM);
    int status = -1;
    for (int i = 0; i < 2 * kTicksPerSecond && waitpid(child_, &status, WNOHANG) == 0; ++i) world_->advance();
    if (!WIFEXITED(status)) return -1;
    child_ = -1;
    return WEXITSTATUS(status);
  }
  // When and why the safety layer took the motors away, and what the robot did without before, from the log;
  // the firmware has ended.
  struct Judgement {
    std::int64_t t_ns = 0;
    std::uint32_t reasons = 0;
    std::uint32_t degraded = 0;
  };
  static Judgement judgement() {
    app::RunLog log(kLog);
    Judgement judged;
    bool armed = false;
    for (runtime::TickRecord tick; log.next(&tick);) {
      const bool now = tick.arm_state == static_cast<int>(ArmState::kArmed);
      if (armed && !now) {
        judged.t_ns = tick.now_ns;
        judged.reasons = tick.reasons;
        break;
      }
      if (now) judged.degraded |= tick.degraded;
      armed = armed || now;
    }
    return judged;
  }
  // From now on no samples come from one device: the model bridges what it may, then the motors go off.
  void expectBridgedAndOff(int bridged, bool data_ready = true) {
    const int ticks = ticksUntilOff(bridged + 10, data_ready);
    EXPECT_GE(ticks, bridged) << "bridged less than configured";
    EXPECT_LE(ticks, bridged + 3);
    EXPECT_LT(world_->tilt_rad(), 0.5) << "it fell meanwhile";
  }
  // A stuck encoder is told apart: motors off and the wheel named while arming, later the robot stays up
  // without the encoder. An eduMIP that stands gives it next to nothing to count and may stand on with it.
  void expectStuckEncoderFound(std::size_t wheel) {
    const bool off = ticksUntilOff(kToFindEncoder) <= kToFindEncoder;
    const std::int64_t off_ns = world_->now_ns();
    EXPECT_LT(world_->tilt_rad(), 0.5) << "it fell before it was found";
    EXPECT_EQ(terminated(), off ? 1 : 0);
    const Judgement judged = judgement();
    if (off) {
      EXPECT_NE(judged.reasons & kEncoderStuck, 0u) << judged.reasons;
      EXPECT_NE(judged.reasons & (kWheelOne << wheel), 0u) << judged.reasons;
      EXPECT_LE(off_ns - judged.t_ns, kThreeTicks_ns);
    } else if (GetParam().wheels.size() > 2 || judged.degraded != 0) {
      EXPECT_EQ(judged.degraded, kWithoutWheelOne << wheel);
    }
  }

  Bench bench_;
  std::optional<PinWorld> world_;
  pid_t child_ = -1;
};

class EveryBoard : public ClosedLoop {};
class KernelImu : public ClosedLoop {};
class EveryImu : public ClosedLoop {};

std::string nameOf(const ::testing::TestParamInfo<PinRobot>& robot) { return robot.param.name; }

// What a robot's own wiring decides runs on each; what the loop around it does, on one.
INSTANTIATE_TEST_SUITE_P(Robots, EveryBoard,
                         ::testing::Values(PinRobot::mbbr(), PinRobot::edumip(), PinRobot::edumip_blue()),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Imus, KernelImu,
                         ::testing::Values(PinRobot::mbbr_mpu6500(), PinRobot::mbbr_mpu6500_on_spi(),
                                           PinRobot::mbbr_lsm6dso()),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Imus, EveryImu,
                         ::testing::Values(PinRobot::mbbr(), PinRobot::mbbr_mpu6500(),
                                           PinRobot::mbbr_lsm6dso()),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Robot, ClosedLoop, ::testing::Values(PinRobot::mbbr()), nameOf);
}  // namespace

TEST_P(EveryBoard, StaysUprightForTwentySecondsAndCoastsOnSigterm) {
  balance(20 * kTicksPerSecond);
  kill(child_, SIGTERM);
  EXPECT_LE(ticksUntilOff(), 3);
  EXPECT_EQ(terminated(), 0);
}

TEST_P(KernelImu, StaysUprightForTwentySeconds) { balance(20 * kTicksPerSecond); }

// The drivers' own calls, each of which reads or writes one device; nothing that waits, locks, allocates or
// logs.
TEST_P(EveryImu, InATickOnlyTheDriversCallTheKernelAndNothingSleeps) {
  SyscallTrace trace(child_);
  balance(kTicksPerSecond);
  trace.begin();
  balance(2 * kTicksPerSecond);
  trace.end();
#ifdef SYS_ppoll_time64  // 32-bit machines have both
  const std::set<int> its_sample = {SYS_ppoll, SYS_ppoll_time64};
  const std::set<int> its_time = {SYS_clock_nanosleep, SYS_clock_nanosleep_time64};
#else
  const std::set<int> its_sample = {SYS_ppoll};
  const std::set<int> its_time = {SYS_clock_nanosleep};
#endif
  const std::vector<TracedTick> ticks = trace.ticks(GetParam().own_pace ? its_time : its_sample);
  ASSERT_GT(ticks.size(), 350U);
  const std::set<int> of_drivers = {SYS_ioctl, SYS_read, SYS_write, SYS_pread64, SYS_pwrite64};
  int most = 0;
  int sleeps = 0;
  for (const TracedTick& tick : ticks) {
    for (const auto& [call, times] : tick.calls) EXPECT_EQ(of_drivers.count(call), 1U) << "call " << call;
    most = std::max(most, tick.sum());
    sleeps += tick.sleeps;
  }
  EXPECT_EQ(sleeps, 0);
  EXPECT_GT(most, 5) << "it reads and writes";
  EXPECT_LE(most, 40);
  printf("trace: %zu ticks, at most %d system calls in one, %d sleeps\n", ticks.size(), most, sleeps);
}

// Its memory is locked: what another process takes away is not its own.
TEST_P(ClosedLoop, GoesOnWhileAnotherProcessTakesAllMemory) {
  balance(kTicksPerSecond);
  const pid_t hog = fork();
  if (hog == 0) takeAllMemory();
  int status = 0;
  for (int i = 0; i < 60 * kTicksPerSecond && waitpid(hog, &status, WNOHANG) == 0; ++i) {
    balance(1);
    if (HasFatalFailure()) break;
  }
  kill(hog, SIGKILL);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << "memory did not run out";
  balance(kTicksPerSecond);
}

TEST_P(EveryBoard, CoastsWithinThreeTicksOfBeingKilled) {
  balance(kToBalance);
  kill(child_, SIGKILL);
  EXPECT_LE(ticksUntilOff(), 3);
}

// The guard cuts, the loop lets go for a tick and goes on (safety.max_stalled_ticks), whatever the phase.
TEST_P(ClosedLoop, CoastsWithinThreeTicksOfBeingStoppedAndStandsOnOnceItGoesOn) {
  constexpr int kSettled = 3;
  balance(kToBalance);
  for (int stop = 0; stop < 5 && !HasFatalFailure(); ++stop) {
    kill(child_, SIGSTOP);
    EXPECT_LE(ticksUntilOff(), 3);
    kill(child_, SIGCONT);
    for (int i = 0; i < kSettled; ++i) world_->advance();
    balance(kTicksPerSecond + 17);  // a second stall within a second is not tolerated
  }
}

TEST_P(ClosedLoop, StaysOffOnceItWasStoppedForLonger) {
  balance(kToBalance);
  kill(child_, SIGSTOP);
  EXPECT_LE(ticksUntilOff(), 3);
  for (int i = 0; i < world_->safety().max_stalled_ticks; ++i) world_->advance();
  kill(child_, SIGCONT);
  for (int i = 0; i < kTicksPerSecond / 2; ++i) {
    world_->advance();
    EXPECT_TRUE(world_->motorsOff()) << "it went on";
  }
}

TEST_P(EveryImu, BridgesAnI2cUnplugThenCoastsWithinThreeTicks) {
  balance(kToBalance);
  bench_.fault("imu", EREMOTEIO, UINT32_MAX);
  expectBridgedAndOff(world_->safety().max_missed_imu);
  EXPECT_EQ(terminated(), 1) << "a run that ended with a fault is a failure";
}

TEST_P(EveryImu, BridgesALostInterruptThenCoastsWithinThreeTicks) {
  balance(kToBalance);
  expectBridgedAndOff(world_->safety().max_missed_imu, false);
}

TEST_P(ClosedLoop, BridgesALostDecoderThenCoastsWithinThreeTicks) {
  balance(kToBalance);
  bench_.fault("counter", ENODEV, UINT32_MAX);
  expectBridgedAndOff(world_->safety().max_missed_encoders);
}

TEST_P(EveryImu, WithoutImuAndDecodersItCoastsSooner) {
  balance(kToBalance);
  bench_.fault("imu", EREMOTEIO, UINT32_MAX);
  bench_.fault("counter", ENODEV, UINT32_MAX);
  expectBridgedAndOff(world_->safety().max_missed_both);
}

TEST_P(EveryBoard, StandsSafelyOnAnEncoderStuckFromTheStart) {
  stickEncoder(1);
  waitUntilArmed();
  expectStuckEncoderFound(1);
}

TEST_P(ClosedLoop, AnEncoderThatSticksWhileDrivingIsFound) {
  balance(kToBalance);
  stickEncoder(0);
  expectStuckEncoderFound(0);
}
