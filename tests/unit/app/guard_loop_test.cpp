// The guard's loop in a thread, bridges that count, a stand-in for the loop it watches. Counted in polls of
// the guard, not in time: a slow machine makes it slower, not wrong.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "app/guard/guard.hpp"
#include "equipoise/runtime/heartbeat.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise {
namespace {

class CountingBridges final : public app::Bridges {
 public:
  int enable() noexcept override {
    ++enables;
    if (enable_error != 0) return enable_error;
    on = true;
    return 0;
  }
  int off() noexcept override {
    ++offs;
    on = false;
    return off_error;
  }
  std::atomic<int> enables{0};
  std::atomic<int> offs{0};
  std::atomic<int> enable_error{0};
  std::atomic<int> off_error{0};
  std::atomic<bool> on{false};
};

class GuardLoop : public ::testing::Test {
 protected:
  GuardLoop() {
    options_.period_ns = 2'000'000;
    options_.silent_ticks = 300;  // a test that is held up for less is no dead loop
  }
  ~GuardLoop() override { finish(); }

  void start() {
    guard_ = std::thread([this] { end_ = app::guard_loop(options_, bridges_, page_, stop_); });
  }
  app::GuardEnd finish() {
    stop_ = true;
    if (guard_.joinable()) guard_.join();
    return end_;
  }

  /// Waits for so many whole polls, beating in each of them or not.
  void polls(std::uint32_t count, bool beating) {
    for (std::uint32_t i = 0; i < count + 1; ++i) {
      const std::int64_t last = page_.guard_ns.load();
      if (beating) beat();
      while (page_.guard_ns.load() == last) std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  }
  void turn_on() {
    page_.want_enable = 1;
    polls(3, true);
    ASSERT_TRUE(bridges_.on);
  }
  void beat() {
    before_last_beat_ns_ = runtime::monotonic_now_ns();
    page_.loop_ns = before_last_beat_ns_;
  }
  void fall_silent() {
    while (page_.cut.load() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  app::GuardOptions options_;
  CountingBridges bridges_;
  runtime::HeartbeatPage page_{};
  std::atomic<bool> stop_{false};
  std::int64_t before_last_beat_ns_ = 0;

 private:
  app::GuardEnd end_;
  std::thread guard_;
};

TEST_F(GuardLoop, WritesOffAgainAndAgainUntilTheFirstBeat) {
  page_.want_enable = 1;
  start();
  polls(10, false);
  EXPECT_GE(bridges_.offs, 10);
  EXPECT_EQ(bridges_.enables, 0);
  const app::GuardEnd end = finish();
  EXPECT_EQ(end.error, 0);
  EXPECT_EQ(end.cuts, 0);
}

TEST_F(GuardLoop, WakesTheBridgesOnceAndLeavesThemToALoopThatBeats) {
  start();
  turn_on();
  const int offs = bridges_.offs;
  polls(50, true);
  EXPECT_EQ(bridges_.enables, 1);
  EXPECT_EQ(bridges_.offs, offs);
  EXPECT_EQ(finish().error, 0);
  EXPECT_FALSE(bridges_.on);  // the last thing it does
  EXPECT_EQ(page_.cut, 0U);
}

TEST_F(GuardLoop, LetsALoopThatBeatsTurnOffAndOnAsItLikes) {
  options_.silent_ticks = 1'000'000;  // half an hour, for which it does not sleep
  start();
  for (int i = 1; i <= 3; ++i) {
    turn_on();
    EXPECT_EQ(bridges_.enables, i);
    const int offs = bridges_.offs;
    page_.want_enable = 0;
    polls(10, true);
    EXPECT_FALSE(bridges_.on);
    EXPECT_EQ(bridges_.offs, offs + 1);
  }
  EXPECT_EQ(page_.cut, 0U);
  EXPECT_EQ(finish().cuts, 0);
}

TEST_F(GuardLoop, CutsASilentLoopAndTakesNoWordOfItUntilItHasLetGo) {
  start();
  turn_on();
  fall_silent();
  const std::int64_t limit_ns = options_.silent_ticks * options_.period_ns;
  EXPECT_FALSE(bridges_.on);
  EXPECT_GT(page_.cut_ns - before_last_beat_ns_, limit_ns);
  EXPECT_LE(page_.cut_ns, runtime::monotonic_now_ns());
  for (const bool beating : {false, true}) {  // off is written in every poll: the loop may write duties again
    const int offs = bridges_.offs;
    polls(10, beating);
    EXPECT_GE(bridges_.offs, offs + 10);
  }
  EXPECT_EQ(bridges_.enables, 1);
  EXPECT_EQ(page_.cut, 1U);
  page_.want_enable = 0;  // as a loop does that knows of no cut
  polls(3, true);
  page_.want_enable = 1;
  polls(3, true);
  EXPECT_FALSE(bridges_.on);
  page_.answered = 1;  // between two polls it has let go and drives on
  polls(3, true);
  EXPECT_TRUE(bridges_.on);
  const int offs = bridges_.offs;
  polls(10, true);
  EXPECT_EQ(bridges_.offs, offs);
  EXPECT_EQ(bridges_.enables, 2);
  EXPECT_EQ(finish().cuts, 1);
}

TEST_F(GuardLoop, ASilentLoopThatIsOffIsNotCut) {
  start();
  polls(3, true);
  polls(330, false);  // silent for more than its limit
  EXPECT_EQ(page_.cut, 0U);
  EXPECT_EQ(finish().cuts, 0);
}

TEST_F(GuardLoop, CutsAtTheLimitAndNotAtTheNextLook) {
  options_.period_ns = 400'000'000;
  options_.silent_ticks = 1;
  page_.want_enable = 1;
  start();
  bool before_next_look = false;  // two ticks after the last; on a busy machine not each time
  for (std::uint32_t cuts = 1; cuts <= 10 && !before_next_look; ++cuts) {
    page_.answered = page_.cut.load();
    while (!bridges_.on) {
      beat();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    while (page_.cut < cuts) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_GT(page_.cut_ns - before_last_beat_ns_, 500'000'000);
    before_next_look = page_.cut_ns - before_last_beat_ns_ < 3 * options_.period_ns / 2;
  }
  EXPECT_TRUE(before_next_look);
}

TEST_F(GuardLoop, ABeatOfTheFutureIsNone) {
  page_.want_enable = 1;
  page_.loop_ns = runtime::monotonic_now_ns() + 3'600'000'000'000;
  start();
  polls(10, false);
  EXPECT_EQ(bridges_.enables, 0);
}

TEST_F(GuardLoop, ABridgeThatDoesNotWakeIsTriedAgainAndReported) {
  bridges_.enable_error = -EIO;
  start();
  page_.want_enable = 1;
  polls(10, true);
  EXPECT_GE(bridges_.enables, 9);
  bridges_.enable_error = 0;
  polls(3, true);
  EXPECT_TRUE(bridges_.on);
  EXPECT_EQ(finish().error, -EIO);
}

TEST_F(GuardLoop, ABridgeThatDoesNotSleepIsReported) {
  start();
  turn_on();
  bridges_.off_error = -ENODEV;
  page_.want_enable = 0;
  polls(3, true);
  bridges_.off_error = 0;
  EXPECT_EQ(finish().error, -ENODEV);
}

TEST_F(GuardLoop, WhatFailedIsReportedAlsoWhenAllSucceedsAfterIt) {
  start();
  bridges_.enable_error = -EIO;
  page_.want_enable = 1;
  polls(3, true);
  bridges_.enable_error = 0;
  turn_on();
  page_.want_enable = 0;
  polls(3, true);
  EXPECT_FALSE(bridges_.on);
  turn_on();
  EXPECT_EQ(finish().error, -EIO);
}

TEST_F(GuardLoop, AFirstOrLastSleepThatFailsIsReported) {
  bridges_.off_error = -EIO;
  start();
  polls(1, true);
  bridges_.off_error = 0;
  EXPECT_EQ(finish().error, -EIO);

  CountingBridges first_well;
  std::atomic<bool> stop{false};
  runtime::HeartbeatPage quiet{};
  app::GuardEnd end;
  std::thread guard([&] { end = app::guard_loop(options_, first_well, quiet, stop); });
  while (quiet.guard_ns.load() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  first_well.off_error = -ENODEV;
  stop = true;
  guard.join();
  EXPECT_EQ(end.error, -ENODEV) << "the last one alone";

  CountingBridges others;
  others.off_error = -ENXIO;
  const std::atomic<bool> at_once{true};
  runtime::HeartbeatPage page{};
  EXPECT_EQ(app::guard_loop(options_, others, page, at_once).error, -ENXIO);
  EXPECT_EQ(others.offs, 2);
}

/// What arrives at the service manager's socket meanwhile.
class Manager {
 public:
  Manager() : path_(std::filesystem::temp_directory_path() / ("notify-" + std::to_string(getpid()))) {
    fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.string().copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", path_.c_str(), 1);
  }
  ~Manager() {
    unsetenv("NOTIFY_SOCKET");
    close(fd_);
    std::filesystem::remove(path_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;
  int alive() const {
    int count = 0;
    char text[64];
    for (ssize_t size = 0; (size = recv(fd_, text, sizeof text, 0)) > 0;)
      count += std::string(text, static_cast<std::size_t>(size)) == "WATCHDOG=1" ? 1 : 0;
    return count;
  }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
};

TEST_F(GuardLoop, TellsTheServiceManagerAtTheStartAndWhenDue) {
  const Manager manager;
  options_.watchdog_ns = 3'600'000'000'000;
  start();
  polls(20, true);
  EXPECT_EQ(manager.alive(), 1);
}

TEST_F(GuardLoop, TellsTheServiceManagerEachTimeItIsDue) {
  const Manager manager;
  options_.watchdog_ns = 1;
  start();
  polls(1, true);
  (void)manager.alive();
  polls(5, true);
  EXPECT_GE(manager.alive(), 5);
}

TEST(Supervisor, TellsWhatForbidsMotors) {
  std::atomic<bool> log_failed{false};
  runtime::Supervisor supervisor({nullptr, 0, &log_failed, true});
  RawSample raw{};
  std::int64_t now_ns = 1'000'000'000;
  const auto tick = [&](std::int64_t took_ns) {
    now_ns += took_ns;
    raw.t_ns = now_ns;
    const std::uint32_t reasons = supervisor.begin(now_ns, raw);
    supervisor.end(false, 0);
    return reasons;
  };
  EXPECT_EQ(tick(5'000'000), 0U);
  EXPECT_EQ(tick(5'000'000), 0U);
  EXPECT_EQ(tick(20'000'000), kOverrun);
  EXPECT_EQ(tick(5'000'000), 0U);
  log_failed = true;
  EXPECT_EQ(tick(5'000'000), kLogFailed);
}

TEST(Supervisor, AsksTheGuardForTheBridgesOfADrivenTick) {
  runtime::HeartbeatPage page{};
  page.cut = 7;  // of somebody before
  runtime::Supervisor supervisor({&page, 0, nullptr, false});
  RawSample raw{};
  std::int64_t now_ns = 1'000'000'000;
  const auto begin = [&] {
    page.guard_ns = now_ns += 5'000'000;
    return supervisor.begin(raw.t_ns = now_ns, raw);
  };
  const std::int64_t started_ns = runtime::monotonic_now_ns();
  EXPECT_EQ(begin(), 0U);
  EXPECT_EQ(page.want_enable, 0U);
  EXPECT_EQ(page.loop_ns, 0) << "a tick that is not over";
  supervisor.end(true, 0);
  EXPECT_EQ(page.want_enable, 1U);
  EXPECT_EQ(page.answered, 0U) << "it has not let go";
  EXPECT_GE(page.loop_ns, started_ns);
  EXPECT_EQ(begin(), 0U);
  page.cut = 8;  // while the tick runs: of this one it does not know
  const std::int64_t beat_ns = page.loop_ns;
  supervisor.end(false, 0);
  EXPECT_GT(page.loop_ns, beat_ns);
  EXPECT_EQ(page.want_enable, 0U);
  EXPECT_EQ(page.answered, 7U);
  raw.t_ns = now_ns += 30'000'000;
  EXPECT_EQ(supervisor.begin(now_ns, raw), kOverrun);  // silent for no more than 30 ms
  supervisor.end(false, 0);
  raw.t_ns = ++now_ns;
  EXPECT_EQ(supervisor.begin(now_ns, raw) & kGuardDead, kGuardDead);
}

}  // namespace
}  // namespace equipoise
