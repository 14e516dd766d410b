// The guard as a process of its own, a stand-in for the loop as another, files in the place of sysfs. Times
// are in the robot's ticks; the machine may be busy, so the best of a few attempts counts, and it is printed.
#include "app/guard/guard.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "equipoise/runtime/supervisor.hpp"

namespace equipoise {
namespace {

constexpr std::int64_t kTick_ns = 5'000'000;
constexpr double kDeadline_ms = 15.0;  // three ticks
constexpr int kAttempts = 20;

class GuardProcess : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() / ("equipoise-guard-" + std::to_string(getpid()));
    std::filesystem::create_directories(dir_);
    for (const char* name : {"enable", "pwm0", "pwm1", "pwm2"}) std::ofstream(dir_ / name) << "0\n";
    name_ = "/equipoise-test-" + std::to_string(getpid());
    guard_ = fork();
    if (guard_ == 0) exec_guard("0");
    connect();
    ASSERT_NE(page_, nullptr) << "the guard did not start";
  }

  void connect() {
    for (int i = 0; i < 1000 && page_ == nullptr; ++i) {
      try {
        page_ = std::make_unique<runtime::SharedHeartbeat>(name_, runtime::SharedHeartbeat::Role::kLoop);
      } catch (const std::runtime_error&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    }
  }

  /// As ps shows it: R, S, Z, ...; '?' when there is none.
  static char state_of(pid_t pid) {
    std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
    std::string id;
    std::string name;
    char state = '?';
    stat >> id >> name >> state;
    return state;
  }

  void TearDown() override {
    end(loop_);
    end(robot_);
    end(guard_);
    shm_unlink(name_.c_str());  // a killed guard leaves its page
    page_.reset();
    std::filesystem::remove_all(dir_);
  }

  /// `parent`: whose end is its own; 0: nobody's.
  [[noreturn]] void exec_guard(const char* parent) const {
    execl(EQUIPOISE_BINARY, "equipoise", "guard", "--heartbeat", name_.c_str(), "--parent", parent,
          "--enable", (dir_ / "enable").c_str(), "--pwm", (dir_ / "pwm0").c_str(), (dir_ / "pwm1").c_str(),
          (dir_ / "pwm2").c_str(), nullptr);
    _exit(127);
  }

  static void end(pid_t& pid) {
    if (pid <= 0) return;
    kill(pid, SIGCONT);
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
    pid = 0;
  }

  /// Beats and writes duties once per tick, until something happens to it; `hang_after` ticks it waits for
  /// ever.
  void start_loop(int hang_after = 1 << 30) {
    loop_ = fork();
    if (loop_ != 0) return;
    std::int64_t due_ns = runtime::monotonic_now_ns();
    page_->page().want_enable.store(1);
    for (int tick = 0;; ++tick) {
      if (tick == hang_after) pause();  // as in a read that never comes back: the lost interrupt
      for (const char* name : {"pwm0", "pwm1", "pwm2"}) std::ofstream(dir_ / name, std::ios::in) << "25000\n";
      page_->page().loop.fetch_add(1);
      due_ns += kTick_ns;
      runtime::sleep_until(due_ns);
    }
  }

  std::string value(const char* name) const {
    std::ifstream file(dir_ / name);
    std::string line;
    file >> line;
    return line;
  }
  bool off() const {
    return value("enable") == "0" && value("pwm0").find_first_not_of('0') == std::string::npos;
  }
  bool wait_for(bool wanted_on, int limit_ms = 5000) const {
    const std::int64_t until = runtime::monotonic_now_ns() + std::int64_t{1'000'000} * limit_ms;
    while (runtime::monotonic_now_ns() < until) {
      if ((value("enable") == "1") == wanted_on) return true;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    return false;
  }

  /// ms from the last beat until the bridges are asleep, best of several attempts.
  template <class Strike>
  double best_off_ms(Strike&& strike, int hang_after = 1 << 30) {
    double best = 1e9;
    for (int i = 0; i < kAttempts && best > kDeadline_ms; ++i) {
      start_loop(hang_after);
      EXPECT_TRUE(wait_for(true));
      std::uint32_t beat = page_->page().loop.load();
      std::int64_t beat_ns = runtime::monotonic_now_ns();
      strike();
      const std::int64_t struck_ns = runtime::monotonic_now_ns();
      while (value("enable") == "1" && runtime::monotonic_now_ns() - struck_ns < 5'000'000'000) {
        const std::uint32_t now = page_->page().loop.load();
        if (now != beat) beat_ns = runtime::monotonic_now_ns();
        beat = now;
      }
      best = std::min(best,
                      1e-6 * static_cast<double>(runtime::monotonic_now_ns() - std::max(beat_ns, struck_ns)));
      EXPECT_TRUE(off());
      end(loop_);
    }
    return best;
  }

  void report(const char* what, double ms) {
    RecordProperty(what, std::to_string(ms));
    std::printf("off %.2f ms after %s\n", ms, what);
  }

  std::filesystem::path dir_;
  std::string name_;
  std::unique_ptr<runtime::SharedHeartbeat> page_;
  pid_t guard_ = 0;
  pid_t loop_ = 0;
  pid_t robot_ = 0;  // whose child is a guard
};

TEST_F(GuardProcess, BridgesSleepUntilTheLoopBeats) {
  EXPECT_TRUE(off());
  start_loop();
  EXPECT_TRUE(wait_for(true));
}

TEST_F(GuardProcess, BridgesSleepWhenTheLoopDoesNotDrive) {
  start_loop();
  ASSERT_TRUE(wait_for(true));
  page_->page().want_enable.store(0);
  EXPECT_TRUE(wait_for(false));
  EXPECT_EQ(page_->page().cut.load(), 0U);  // not late: nothing to disarm for
}

TEST_F(GuardProcess, EndsWithTheProcessThatStartedIt) {
  end(guard_);
  shm_unlink(name_.c_str());  // of the one just killed
  int to_parent[2];
  ASSERT_EQ(pipe(to_parent), 0);
  robot_ = fork();
  if (robot_ == 0) {
    const pid_t guard = fork();
    if (guard == 0) exec_guard(std::to_string(getppid()).c_str());
    (void)!write(to_parent[1], &guard, sizeof guard);
    pause();
  }
  pid_t guard = 0;
  ASSERT_EQ(read(to_parent[0], &guard, sizeof guard), static_cast<ssize_t>(sizeof guard));
  page_.reset();
  connect();
  while (page_->page().guard.load() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  start_loop();
  ASSERT_TRUE(wait_for(true));
  end(robot_);
  EXPECT_TRUE(wait_for(false));  // although somebody beats
  for (int i = 0; i < 1000 && kill(guard, 0) == 0 && state_of(guard) != 'Z'; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(kill(guard, 0) != 0 || state_of(guard) == 'Z');  // an orphan may wait for somebody to reap it
  close(to_parent[0]);
  close(to_parent[1]);
}

TEST_F(GuardProcess, StopsTheMotorsOfAKilledLoop) {
  const double ms = best_off_ms([this] { kill(loop_, SIGKILL); });
  report("SIGKILL", ms);
  EXPECT_LE(ms, kDeadline_ms);
}

TEST_F(GuardProcess, StopsTheMotorsOfAStoppedLoop) {
  const double ms = best_off_ms([this] { kill(loop_, SIGSTOP); });
  report("SIGSTOP", ms);
  EXPECT_LE(ms, kDeadline_ms);
}

TEST_F(GuardProcess, StopsTheMotorsOfALoopThatWaitsForALostInterrupt) {
  const double ms = best_off_ms(
      [this] {
        std::uint32_t last = 0;
        do {  // until it beats no more
          last = page_->page().loop.load();
          std::this_thread::sleep_for(std::chrono::microseconds(5500));
        } while (last != page_->page().loop.load());
      },
      40);
  report("lost interrupt", ms);
  EXPECT_LE(ms, kDeadline_ms);
}

TEST_F(GuardProcess, MotorsStayOffWhenAStoppedLoopWakesUp) {
  start_loop();
  ASSERT_TRUE(wait_for(true));
  kill(loop_, SIGSTOP);
  ASSERT_TRUE(wait_for(false));
  const std::uint32_t cut = page_->page().cut.load();
  EXPECT_GE(cut, 1U);  // what tells the loop to disarm
}

TEST(SupervisorTest, ADeadGuardForbidsMotors) {
  runtime::HeartbeatPage page{};
  runtime::Supervisor supervisor({&page, 0, nullptr, false});
  RawSample raw{};
  std::int64_t now = 1'000'000'000;
  const auto tick = [&](bool guard_lives) {
    now += kTick_ns;
    raw.t_ns = now;
    if (guard_lives) page.guard.fetch_add(2);
    const std::uint32_t reasons = supervisor.begin(now, raw);
    supervisor.end(true, 0);
    return reasons;
  };
  EXPECT_EQ(tick(false), kGuardDead);  // never seen
  EXPECT_EQ(tick(true), 0U);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tick(true), 0U);
  int silent = 0;
  while (tick(false) == 0 && silent < 100) ++silent;
  EXPECT_LE(silent, 6);
  EXPECT_EQ(tick(true), 0U);
  page.cut.fetch_add(1);  // the guard found us too late
  EXPECT_EQ(tick(true), kOverrun);
  EXPECT_EQ(page.loop.load(), static_cast<std::uint32_t>(105 + silent));
}

TEST(SupervisorTest, AFailedWriteForbidsMotors) {
  runtime::Supervisor supervisor({nullptr, kRealtimeMissing, nullptr, false});
  RawSample raw{};
  raw.t_ns = kTick_ns;
  EXPECT_EQ(supervisor.begin(kTick_ns, raw), kRealtimeMissing);
  supervisor.end(false, -EIO);
  raw.t_ns = 2 * kTick_ns;
  EXPECT_EQ(supervisor.begin(2 * kTick_ns, raw), kRealtimeMissing | kWriteFailed);
}

}  // namespace
}  // namespace equipoise
