// Requests become what the tick is told: they expire, a disarm always lets go, a fault needs a new request.
#include "equipoise/runtime/command_follower.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "equipoise/runtime/latest_value.hpp"

namespace equipoise::runtime {
namespace {

// Copies: the generated constants have no address.
constexpr auto kOff = command_session_t::OFF;
constexpr auto kWaiting = command_session_t::WAITING;
constexpr auto kMotorsOn = command_session_t::ARMED;
constexpr auto kFaulty = command_session_t::FAULT;

class Follower : public ::testing::Test {
 protected:
  void arm(std::int64_t until_ms = 500) {
    ++wish_.turn;
    ++wish_.arms;
    wish_.arm = true;
    wish_.arm_until_ms = until_ms;
  }
  void disarm() {
    ++wish_.turn;
    ++wish_.disarms;
    wish_.arm = false;
  }
  /// One tick of a robot that does `then` when it is asked for its motors.
  bool asked(double now_ms, ArmState then) {
    const bool asked_now = follower_.update(wish_, now_ms).arm;
    follower_.tell(then);
    return asked_now;
  }

  CommandWish wish_;
  CommandFollower follower_;
};

TEST_F(Follower, ARequestThatTheRobotCannotMeetIsForgotten) {
  EXPECT_FALSE(asked(0, ArmState::kDisarmed));
  arm();
  EXPECT_TRUE(asked(400, ArmState::kDisarmed));
  EXPECT_EQ(follower_.state(), kWaiting);
  EXPECT_TRUE(asked(500, ArmState::kDisarmed));
  EXPECT_FALSE(asked(501, ArmState::kDisarmed));
  EXPECT_EQ(follower_.state(), kOff);
  EXPECT_FALSE(asked(100, ArmState::kDisarmed));  // and stays so, whatever the clock says
}

TEST_F(Follower, ARequestThatArrivesTooLateIsNone) {
  arm();
  EXPECT_FALSE(asked(8000, ArmState::kDisarmed));
}

TEST_F(Follower, ArmedMotorsStayUntilADisarm) {
  arm();
  EXPECT_TRUE(asked(10, ArmState::kArmed));
  EXPECT_TRUE(asked(60000, ArmState::kArmed));
  EXPECT_EQ(follower_.state(), kMotorsOn);
  disarm();
  EXPECT_FALSE(asked(60005, ArmState::kDisarmed));
  EXPECT_FALSE(asked(60010, ArmState::kDisarmed));
}

TEST_F(Follower, ADisarmLetsGoEvenWhenSomebodyHasArmedSince) {
  arm();
  EXPECT_TRUE(asked(10, ArmState::kArmed));
  disarm();
  arm();
  EXPECT_FALSE(asked(15, ArmState::kDisarmed));
  EXPECT_TRUE(asked(20, ArmState::kArmed));
}

TEST_F(Follower, AFaultStaysUntilANewRequestWhichFirstLetsGo) {
  arm();
  EXPECT_TRUE(asked(10, ArmState::kFault));
  EXPECT_TRUE(asked(3000, ArmState::kFault));  // safety's latch shows its reasons as long as it is asked
  EXPECT_EQ(follower_.state(), kFaulty);
  arm(4000);
  EXPECT_FALSE(asked(3600, ArmState::kDisarmed));
  EXPECT_TRUE(asked(3605, ArmState::kArmed));
}

TEST_F(Follower, ResetsTheHeadingOnceAndTellsTheAge) {
  wish_.heading_resets = 1;
  wish_.heard_ms = 100;
  wish_.velocity_W_m_s[1] = 0.5;
  const Command first = follower_.update(wish_, 350);
  EXPECT_TRUE(first.heading_reset);
  EXPECT_DOUBLE_EQ(first.age_s, 0.25);
  EXPECT_EQ(first.velocity_W_m_s.y(), 0.5);
  EXPECT_FALSE(follower_.update(wish_, 355).heading_reset);
}

TEST(LatestValue, IsWholeAndNeverGoesBack) {
  struct Pair {
    std::int64_t a, b;
  };
  LatestValue<Pair> value({0, 0});
  constexpr std::int64_t kLast = 200000;
  std::thread writer([&] {
    for (std::int64_t i = 1; i <= kLast; ++i) value.put({i, -i});
  });
  std::int64_t newest = 0;
  while (newest < kLast) {
    const Pair now = value.get();
    ASSERT_EQ(now.a, -now.b);
    ASSERT_GE(now.a, newest);
    newest = now.a;
  }
  writer.join();
}

}  // namespace
}  // namespace equipoise::runtime
