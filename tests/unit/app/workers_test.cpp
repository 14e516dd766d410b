// Threads that are asked again and again: all is done, once, and what goes wrong is said.
#include "app/sim/workers.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <stdexcept>
#include <thread>
#include <vector>

namespace equipoise::app {
namespace {

TEST(Workers, DoEachOnceRoundAfterRound) {
  Workers workers(3);
  std::vector<int> done(7, 0);
  for (int round = 1; round <= 2000; ++round) {
    workers.each(7, [&](int i) { ++done[static_cast<std::size_t>(i)]; });
    ASSERT_EQ(done, std::vector<int>(7, round));
  }
  workers.each(0, [](int) { FAIL() << "there is nothing to do"; });
}

TEST(Workers, ThrowTheFirstFailureAndWorkOn) {
  Workers workers(2);
  std::atomic<int> begun{0};
  const auto fails = [&](int i) {
    ++begun;
    if (i == 3) throw std::runtime_error("the third");
  };
  EXPECT_THROW(workers.each(1'000'000'000, fails), std::runtime_error);
  EXPECT_LT(begun, 1'000'000'000) << "the rest is not begun";
  std::atomic<int> sum{0};
  workers.each(5, [&](int i) { sum += i; });
  EXPECT_EQ(sum, 10);
}

/// Returns when it has been called by two threads.
class Meeting {
 public:
  void attend() {
    for (++here_; here_ < 2;) std::this_thread::yield();
  }

 private:
  std::atomic<int> here_{0};
};

TEST(Workers, WakeUpAfterALongPauseAndKeepTheirShares) {
  Workers workers(2);
  const auto here = std::this_thread::get_id();
  for (int round = 0; round < 20; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));  // now they sleep
    std::array<Meeting, 2> meetings;
    workers.each(4, [&](int i) {
      meetings[static_cast<std::size_t>(i % 2)].attend();
      EXPECT_EQ(std::this_thread::get_id() == here, i < 2);
    });
  }
}

TEST(Workers, AreWaitedForHoweverLongTheyTake) {
  Workers workers(2);
  for (int round = 0; round < 20; ++round) {
    Meeting meeting;
    std::atomic<bool> done{false};
    workers.each(2, [&](int i) {
      meeting.attend();
      if (i == 0) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));  // now the caller sleeps
      done = true;
    });
    EXPECT_TRUE(done);
  }
}

TEST(Workers, OneThreadIsTheCallers) {
  Workers alone(1);
  const auto here = std::this_thread::get_id();
  alone.each(5, [&](int) { EXPECT_EQ(std::this_thread::get_id(), here); });
}

}  // namespace
}  // namespace equipoise::app
