// The guard as a process of its own, a stand-in for the loop as another, files in the place of sysfs. Times
// are counted from the loop's last beat to the guard's last write; the worst of all runs counts.
#include "app/guard/guard.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "equipoise/runtime/supervisor.hpp"

namespace equipoise {
namespace {

constexpr std::int64_t kTick_ns = 5'000'000;
constexpr double kDeadline_ms = 15.0;  // three ticks
constexpr double kSilent_ms = 7.5;     // two ticks, less what a poll may miss
constexpr int kStrikes = 10;
constexpr int kIdleTicks = 4;  // of a loop, before it asks for its motors

/// How late a thread of real-time priority wakes on the worse of the cores: what the machine takes of each.
class Pauses {
 public:
  Pauses() {
    for (unsigned core = 0; core < std::thread::hardware_concurrency(); ++core)
      watchers_.emplace_back([this, core] { watch(core); });
  }
  ~Pauses() {
    done_ = true;
    for (std::thread& each : watchers_) each.join();
  }
  /// The longest since the last call, ms.
  double longest_ms() { return 1e-6 * static_cast<double>(longest_ns_.exchange(0)); }

 private:
  static constexpr std::int64_t kNap_ns = 500'000;
  void watch(unsigned core) {
    cpu_set_t where;
    CPU_ZERO(&where);
    CPU_SET(core, &where);
    sched_setaffinity(0, sizeof where, &where);
    const sched_param highest{sched_get_priority_max(SCHED_FIFO)};
    sched_setscheduler(0, SCHED_FIFO, &highest);
    while (!done_) {
      const std::int64_t from_ns = runtime::monotonic_now_ns();
      std::this_thread::sleep_for(std::chrono::nanoseconds(kNap_ns));
      const std::int64_t late_ns = runtime::monotonic_now_ns() - from_ns - kNap_ns;
      for (std::int64_t most = longest_ns_;
           late_ns > most && !longest_ns_.compare_exchange_weak(most, late_ns);) {
      }
    }
  }
  std::atomic<std::int64_t> longest_ns_{0};
  std::atomic<bool> done_{false};
  std::vector<std::thread> watchers_;
};

class GuardProcess : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() / ("equipoise-guard-" + std::to_string(getpid()));
    std::filesystem::create_directories(dir_);
    for (const char* name : {"enable", "pwm0", "pwm1", "pwm2"}) std::ofstream(dir_ / name) << "0\n";
    void* const memory =
        mmap(nullptr, sizeof *beat_ns_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    beat_ns_ = new (memory) std::atomic<std::int64_t>{0};
    guard_ = fork();
    if (guard_ == 0) exec_guard("0");
    ASSERT_TRUE(beats()) << "the guard did not start";
  }

  bool beats() {
    for (int i = 0; i < 1000 && page().guard_ns.load() == 0; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return page().guard_ns.load() != 0;
  }
  runtime::HeartbeatPage& page() { return heartbeat_.page(); }

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
    munmap(beat_ns_, sizeof *beat_ns_);
    std::filesystem::remove_all(dir_);
  }

  /// `parent`: whose end is its own; 0: nobody's.
  [[noreturn]] void exec_guard(const char* parent) const {
    const int fd = dup(heartbeat_.fd());  // without close-on-exec
    execl(EQUIPOISE_BINARY, "equipoise", "guard", "--heartbeat-fd", std::to_string(fd).c_str(), "--parent",
          parent, "--enable", (dir_ / "enable").c_str(), "--pwm", (dir_ / "pwm0").c_str(),
          (dir_ / "pwm1").c_str(), (dir_ / "pwm2").c_str(), nullptr);
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
    page().want_enable.store(0);
    page().answered.store(page().cut);
    for (int tick = 0;; ++tick) {
      if (tick == kIdleTicks) page().want_enable.store(1);
      if (tick == hang_after) pause();  // as in a read that never comes back: the lost interrupt
      for (const char* name : {"pwm0", "pwm1", "pwm2"}) std::ofstream(dir_ / name, std::ios::in) << "25000\n";
      beat_ns_->store(runtime::monotonic_now_ns());
      page().loop_ns.store(*beat_ns_);
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
  /// The guard writes one file after the other.
  bool soon_off() const {
    const auto zero = [this](const char* name) {
      return value(name).find_first_not_of('0') == std::string::npos && !value(name).empty();
    };
    for (int i = 0; i < 1000; ++i) {
      if (zero("enable") && zero("pwm0") && zero("pwm1") && zero("pwm2")) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }
  bool wait_for(bool wanted_on, int limit_ms = 5000) const {
    const std::int64_t until = runtime::monotonic_now_ns() + std::int64_t{1'000'000} * limit_ms;
    while (runtime::monotonic_now_ns() < until) {
      if ((value("enable") == "1") == wanted_on) return true;
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    return false;
  }

  /// ms from the last beat until the bridges are asleep and the PWM is at zero, by the guard's own clock; the
  /// worst of all strikes, less what the machine paused in each.
  template <class Strike>
  double worst_off_ms(Strike&& strike, int hang_after = 1 << 30) {
    double worst = 0.0;
    Pauses pauses;
    for (int i = 0; i < kStrikes; ++i) {
      const std::uint32_t cuts = page().cut.load();
      start_loop(hang_after);
      EXPECT_TRUE(wait_for(true));
      pauses.longest_ms();
      strike();
      const std::int64_t limit_ns = runtime::monotonic_now_ns() + 5'000'000'000;
      while (page().cut.load() == cuts && runtime::monotonic_now_ns() < limit_ns)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      EXPECT_EQ(page().cut.load(), cuts + 1);
      const double off_ms = 1e-6 * static_cast<double>(page().cut_ns.load() - beat_ns_->load());
      worst = std::max(worst, off_ms - pauses.longest_ms());
      EXPECT_TRUE(soon_off());
      end(loop_);
    }
    return worst;
  }

  /// The guard's scheduler, as the kernel shows it.
  bool guard_is_realtime() const { return sched_getscheduler(guard_) == SCHED_FIFO; }

  void judge(const char* what, double ms) {
    std::printf("off %.2f ms after %s\n", ms, what);
    if (!guard_is_realtime()) GTEST_SKIP() << "no real-time priority here: " << ms << " ms is no evidence";
    EXPECT_LE(ms, kDeadline_ms);
    EXPECT_GE(ms, kSilent_ms);  // a guard that cuts earlier cuts loops that are well
  }

  std::filesystem::path dir_;
  runtime::SharedHeartbeat heartbeat_;
  std::atomic<std::int64_t>* beat_ns_ = nullptr;  // when the stand-in last beat
  pid_t guard_ = 0;
  pid_t loop_ = 0;
  pid_t robot_ = 0;  // whose child is a guard
};

TEST_F(GuardProcess, BridgesSleepUntilTheLoopBeats) {
  EXPECT_TRUE(soon_off());
  start_loop();
  EXPECT_TRUE(wait_for(true));
}

TEST_F(GuardProcess, BridgesSleepWhenTheLoopDoesNotDrive) {
  start_loop();
  ASSERT_TRUE(wait_for(true));
  page().want_enable.store(0);
  EXPECT_TRUE(wait_for(false));
  EXPECT_EQ(page().cut.load(), 0U);  // not late: nothing to disarm for
}

TEST_F(GuardProcess, EndsWithTheProcessThatStartedIt) {
  end(guard_);
  page().guard_ns.store(0);
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
  ASSERT_TRUE(beats());
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
  const double ms = worst_off_ms([this] { kill(loop_, SIGKILL); });
  judge("SIGKILL", ms);
}

TEST_F(GuardProcess, StopsTheMotorsOfAStoppedLoop) {
  const double ms = worst_off_ms([this] { kill(loop_, SIGSTOP); });
  judge("SIGSTOP", ms);
}

TEST_F(GuardProcess, StopsTheMotorsOfALoopThatWaitsForALostInterrupt) {
  const double ms = worst_off_ms(
      [this] {
        std::int64_t last = 0;
        do {  // until it beats no more
          last = page().loop_ns.load();
          std::this_thread::sleep_for(std::chrono::microseconds(5500));
        } while (last != page().loop_ns.load());
      },
      40);
  judge("lost interrupt", ms);
}

TEST_F(GuardProcess, MotorsStayOffWhenAStoppedLoopWakesUpUntilItHasLetGo) {
  start_loop();
  ASSERT_TRUE(wait_for(true));
  const std::uint32_t cut = page().cut.load();
  kill(loop_, SIGSTOP);
  ASSERT_TRUE(wait_for(false));
  kill(loop_, SIGCONT);
  const std::int64_t woken_ns = page().loop_ns.load();
  for (int i = 0; i < 200; ++i) {  // it beats and asks for its motors as if nothing had happened
    EXPECT_EQ(value("enable"), "0") << i << " ms after it woke";
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_GT(page().loop_ns.load(), woken_ns + 10 * kTick_ns);
  EXPECT_EQ(page().cut.load(), cut + 1);  // what tells the loop to disarm
  page().answered.store(cut + 1);
  EXPECT_TRUE(wait_for(true));
}

}  // namespace
}  // namespace equipoise
