// The lines of `equipoise send --live`, and what a robot at the other end of a serial line makes of them.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "app/run/conversation.hpp"
#include "app/text/json.hpp"
#include "equipoise/types.hpp"
#include "support/live_relay.hpp"

namespace equipoise::app {
namespace {

TEST(LiveRequest, NamesAnAction) {
  EXPECT_EQ(live_request("arm")->action, std::int8_t{signed_command_t::ARM});
  EXPECT_EQ(live_request(" disarm ")->action, std::int8_t{signed_command_t::DISARM});
  EXPECT_EQ(live_request("heading-reset")->action, std::int8_t{signed_command_t::HEADING_RESET});
  EXPECT_EQ(live_request("take")->action, std::int8_t{signed_command_t::ASK});
}

TEST(LiveRequest, DrivesInTheUnitsOfTheCommandLine) {
  const auto request = live_request("drive 0.1 -0.2 0.5");
  ASSERT_TRUE(request);
  EXPECT_EQ(request->action, std::int8_t{signed_command_t::DRIVE});
  EXPECT_DOUBLE_EQ(request->motion.velocity_W_m_s[0], 0.1);
  EXPECT_DOUBLE_EQ(request->motion.velocity_W_m_s[1], -0.2);
  EXPECT_DOUBLE_EQ(request->motion.yaw_rate_rad_s, kPi);
}

TEST(LiveRequest, TakesNothingElse) {
  for (const char* line :
       {"", "ARM", "arm now", "drive", "drive 1", "drive 0 0 0 0", "drive a 0 0", "drive nan 0 0",
        "drive 2.1 0 0", "drive 0 -2.1 0", "drive 0 0 5.1", "drive 1e999 0 0"})
    EXPECT_FALSE(live_request(line)) << line;
}

TEST(LiveRequest, TheRangesBelongToIt) {
  for (const char* line : {"drive 2 2 5", "drive -2 -2 -5"}) EXPECT_TRUE(live_request(line)) << line;
  for (const char* line : {"drive -2.1 0 0", "drive 0 2.1 0", "drive 0 0 -5.1", "drive 0 inf 0", "take it"})
    EXPECT_FALSE(live_request(line)) << line;
}

constexpr int kQuick = 115200;
const std::vector<std::string> kLadder{"waiting", "armed", "fault"};
constexpr int kSlow = 1200;  // a command takes longer than a second: the next one waits

TEST_F(Relay, ArmsDrivesAndDisarmsAndEndsWithItsInput) {
  start(kQuick, requests_[0]);
  say("arm\n");
  ASSERT_TRUE(soon([&] { return tick().arm; }));
  say("dri");  // in pieces, and more than one at once
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  say("v");
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  say("e 0.1 0 0\ntake\n");
  EXPECT_TRUE(soon([&] { return tick().velocity_W_m_s.x() == 0.1; }));
  EXPECT_FALSE(returned_);
  say("disarm\n");
  ASSERT_TRUE(soon([&] { return !tick().arm; }));
  end();
  EXPECT_TRUE(returned_);
}

TEST_F(Relay, ADisarmIsCarriedOutThoughItsInputHasEnded) {
  start(kQuick, requests_[0]);
  say("arm\n");
  ASSERT_TRUE(soon([&] { return tick().arm; }));
  say("disarm\n");
  close(requests_[1]);
  requests_[1] = -1;
  EXPECT_TRUE(soon([&] { return !tick().arm; }));
}

TEST_F(Relay, ADisarmIsSaidUntilTheMotorsAreOff) {
  arguments_.disarm = stays_on_ = true;
  start(kQuick, requests_[0]);
  EXPECT_FALSE(soon([&] { return returned_.load(); }, 0.5));
  stays_on_ = false;
  EXPECT_TRUE(soon([&] { return returned_.load(); }));
  EXPECT_EQ(error_, "");
}

TEST_F(Relay, ALineWithoutEndEndsIt) {
  start(kQuick, requests_[0]);
  const std::string noise(1 << 15, 'x');
  say(noise);
  EXPECT_FALSE(soon([&] { return returned_.load(); }, 0.3));
  say(noise);
  EXPECT_FALSE(soon([&] { return returned_.load(); }, 0.3)) << "this much is read";
  say("x");
  EXPECT_TRUE(soon([&] { return returned_.load(); }));
}

TEST_F(Relay, ALineThatIsNoRequestIsNamed) {
  start(kQuick, requests_[0]);
  say("jump\n");
  ASSERT_TRUE(soon([&] { return returned_.load(); }));
  EXPECT_EQ(error_.find("--live: 'jump': expected arm, disarm, "), 0U) << error_;
}

TEST_F(Relay, ARobotThatFallsSilentIsGone) {
  start(kQuick, requests_[0], 3.0);
  EXPECT_FALSE(soon([&] { return returned_.load(); }, 4.0)) << "as long as it speaks: " << error_;
  robot_.reset();
  for (int i = 0; i < 4000 && !returned_; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_TRUE(returned_);
  EXPECT_EQ(error_, "mbbr no longer answers");
}

TEST_F(Relay, SaysWhatTheRobotConfirmsAndEachOnce) {
  testing::internal::CaptureStdout();
  start(kQuick, requests_[0]);
  const auto stays = [&](ArmState state) {
    for (int i = 0; i < 80; ++i) {
      (void)robot_->latest();
      robot_->tell(state);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  };
  stays(ArmState::kDisarmed);
  say("arm\n");
  ASSERT_TRUE(soon([&] { return robot_->latest().arm; }));
  stays(ArmState::kDisarmed);
  stays(ArmState::kArmed);
  stays(ArmState::kFault);
  end();
  std::istringstream lines(testing::internal::GetCapturedStdout());
  std::vector<std::string> states;
  std::string before;
  for (std::string line; std::getline(lines, line); before = line) {
    EXPECT_NE(line, before);
    const nlohmann::json said = nlohmann::json::parse(line);
    EXPECT_EQ(said["mine"], true) << line;
    if (states.empty() || states.back() != said["state"]) states.push_back(said["state"]);
  }
  EXPECT_NE(std::search(states.begin(), states.end(), kLadder.begin(), kLadder.end()), states.end())
      << testing::PrintToString(states);
}

TEST_F(Relay, ARobotThatStartsAnewEndsIt) {
  start(kQuick, requests_[0]);
  robot_.reset();
  start_robot();
  ASSERT_TRUE(soon([&] { return returned_.load(); }));
  EXPECT_EQ(error_, "mbbr has started anew, or there are two of that name");
}

TEST_F(Relay, WhoStopsWritingStopsTheMotion) {
  start(kQuick, requests_[0]);
  ASSERT_TRUE(asks(0.1));
  EXPECT_TRUE(soon([&] { return tick().age_s > 1.0; })) << "a line is said once";
}

TEST_F(Relay, AMotionOfTheTurnBeforeIsVoid) {
  start(kQuick, requests_[0]);
  ASSERT_TRUE(asks(0.1));
  say("drive 0.3 0 0\nheading-reset\n");
  ASSERT_TRUE(soon([&] { return tick().heading_reset; }));
  EXPECT_FALSE(soon([&] { return tick().velocity_W_m_s.x() == 0.3; }, 0.7));
}

TEST_F(Relay, AnArmInTheSameBreathAsADisarmIsVoid) {
  start(kQuick, requests_[0]);
  ASSERT_TRUE(asks(0.1));
  say("arm\n");
  ASSERT_TRUE(soon([&] { return tick().arm; }));
  say("disarm\narm\n");
  ASSERT_TRUE(soon([&] { return !tick().arm; }));
  EXPECT_FALSE(soon([&] { return tick().arm; }, 0.7));
}

TEST_F(Relay, AnArmThatIsNotConfirmedInTimeIsForgottenADisarmIsNot) {
  start(kQuick, requests_[0], 2.0);
  ASSERT_TRUE(asks(0.1));
  const auto said_to_the_deaf = [this](const std::string& request) {
    ear_ = RobotsLines::kDeaf;
    say(request);
    soon([] { return false; }, 2.5);
    ear_ = RobotsLines::kHears;
  };
  said_to_the_deaf("arm\n");
  EXPECT_FALSE(soon([&] { return tick().arm; }, 0.7)) << "it would surprise";
  say("arm\n");
  ASSERT_TRUE(soon([&] { return tick().arm; }));
  said_to_the_deaf("disarm\n");
  EXPECT_TRUE(soon([&] { return !tick().arm; })) << "never too late";
}

TEST_F(Relay, AnArmThatIsStillOnItsWayDoesNotCancelTheDisarmBehindIt) {
  start(kSlow, requests_[0]);
  ASSERT_TRUE(asks(0.1));
  ear_ = RobotsLines::kKeepsFirst;
  for (const char* request : {"arm\n", "disarm\n"}) {
    say(request);
    soon([] { return false; }, 1.2);
  }
  ear_ = RobotsLines::kHears;
  ASSERT_TRUE(soon([&] { return armings_ == 1; }));
  EXPECT_TRUE(soon([&] { return !tick().arm; }));
}

TEST_F(Relay, WhoTakesOverMakesWhatTheOtherAsksForVoidUntilItIsTakenBack) {
  int guests_robot = -1, guests_end = -1;
  char name[64] = {};
  ASSERT_EQ(openpty(&guests_robot, &guests_end, name, nullptr, nullptr), 0);
  lines_.push_back(guests_robot);
  testing::internal::CaptureStdout();
  start(kQuick, requests_[0]);
  ASSERT_TRUE(asks(0.1));
  std::atomic<bool> disarmed{false};
  std::thread guest([&] {
    SendArguments arguments;
    arguments.url = "serial:" + std::string(name) + ":" + std::to_string(kQuick);
    arguments.holder = "guest";
    arguments.timeout_s = kPatience_s;
    arguments.disarm = true;
    Conversation conversation(arguments, keys_);
    conversation.find_robots();
    conversation.disarm_all();
    disarmed = true;
  });
  EXPECT_TRUE(soon([&] { return disarmed.load(); }));
  guest.join();
  soon([] { return false; }, 0.5);  // until it is known
  say("drive 0.2 0 0\n");
  EXPECT_FALSE(soon([&] { return tick().velocity_W_m_s.x() == 0.2; }, 0.5));
  say("take\n");
  EXPECT_TRUE(asks(0.3));
  end();
  const std::string said = testing::internal::GetCapturedStdout();
  std::istringstream lines(said);
  std::vector<std::string> mine;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json now = nlohmann::json::parse(line);
    const std::string whose = now["mine"] == true ? "mine" : "not mine";
    const std::string state =
        whose + " " + std::to_string(now["turn"].get<int>()) + now["holder"].get<std::string>();
    if (mine.empty() || mine.back() != state) mine.push_back(state);
  }
  EXPECT_EQ(mine, (std::vector<std::string>{"mine 0", "not mine 1guest", "mine 1guest"})) << said;
  for (const int fd : {guests_robot, guests_end}) close(fd);
}

TEST_F(Relay, AnInputThatCannotBeReadEndsIt) {
  const int folder = open("/", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  start(kQuick, folder);
  EXPECT_TRUE(soon([&] { return returned_.load(); }));
  end();
  close(folder);
}

TEST_F(Relay, WhatWasAskedForBeforeItWasStoppedIsVoid) {
  start(kSlow, requests_[0]);
  const auto faster = [&] { return tick().velocity_W_m_s.x() > 0.15; };
  ASSERT_TRUE(stop_it_before("drive 0.2 0 0\n", faster, ""));
  testing::internal::CaptureStderr();
  say("drive 0.3 0 0\n");
  resume_after(1.4);  // longer than a request lives
  EXPECT_FALSE(soon(faster, 3.0));
  EXPECT_NE(testing::internal::GetCapturedStderr().find("what was asked before is void"), std::string::npos);
  EXPECT_TRUE(asks(0.4)) << "and goes on with what is asked from then on";
}

TEST_F(Relay, AnArmThatWaitsWhileItIsStoppedIsVoidADisarmIsNot) {
  start(kSlow, requests_[0]);
  const auto armed = [&] { return tick().arm; };
  ASSERT_TRUE(stop_it_before("arm\n", armed, "disarm\n"));
  resume_after(1.4);
  EXPECT_FALSE(soon(armed, 3.0));
  say("arm\n");
  ASSERT_TRUE(soon(armed));
  stop_it();
  say("disarm\n");
  resume_after(1.4);
  EXPECT_TRUE(soon([&] { return !armed(); })) << "never too late";
}

}  // namespace
}  // namespace equipoise::app
