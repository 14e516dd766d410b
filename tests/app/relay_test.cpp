// The lines of `equipoise send --live`, and what a robot at the other end of a serial line makes of them.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <exception>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "app/run/conversation.hpp"
#include "app/text/json.hpp"
#include "equipoise/runtime/command_receiver.hpp"
#include "equipoise/types.hpp"

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

using runtime::CommandKey;
using runtime::CommandKeys;
using runtime::CommandReceiver;

/// The robot's end: a pseudo-terminal, however fast the other end believes it to be.
class Terminal final : public runtime::ByteStream {
 public:
  explicit Terminal(int fd) : fd_(fd) { fcntl(fd_, F_SETFL, O_NONBLOCK); }
  std::size_t read(std::uint8_t* out, std::size_t size) override { return some(::read(fd_, out, size)); }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    return some(::write(fd_, data, size));
  }
  double bytes_per_s() const override { return 11520.0; }

 private:
  static std::size_t some(ssize_t n) { return n > 0 ? static_cast<std::size_t>(n) : 0; }
  int fd_;
};

class Relay : public ::testing::Test {
 protected:
  static constexpr double kPatience_s = 20.0;  // of this test with a busy machine

  void SetUp() override {
    char name[64] = {};
    ASSERT_EQ(openpty(&robots_, &holders_, name, nullptr, nullptr), 0);
    ASSERT_EQ(pipe(requests_), 0);
    device_ = name;
  }
  void TearDown() override {
    end();
    robot_.reset();
    for (const int fd : {robots_, holders_, requests_[0]}) close(fd);
  }

  /// Returns when a robot has been found. `requests`: from which lines come.
  void start(int baud, int requests, double patience_s = kPatience_s) {
    const CommandKeys keys = CommandKeys::of_robot("mbbr", CommandKey({1, 2, 3}));
    robot_ = std::make_unique<CommandReceiver>(
        keys, runtime::CommandReceiverOptions{"", kPatience_s, {}},
        std::make_unique<runtime::StreamWire>(std::make_unique<Terminal>(robots_)));
    arguments_.url = "serial:" + device_ + ":" + std::to_string(baud);
    arguments_.timeout_s = patience_s;
    thread_ = std::thread([this, keys, requests] {
      Conversation conversation(arguments_, keys);
      conversation.find_robots();
      found_ = true;
      try {
        arguments_.disarm ? conversation.disarm_all() : conversation.relay(requests);
      } catch (const std::exception& failure) {
        error_ = failure.what();
      }
      returned_ = true;
    });
    ASSERT_TRUE(soon([this] { return found_.load(); }));
  }
  void say(const std::string& text) const {
    ASSERT_EQ(write(requests_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void end() {
    if (requests_[1] >= 0) close(requests_[1]);
    requests_[1] = -1;
    if (thread_.joinable()) thread_.join();
  }
  /// The robot's loop, which does at once what it is told.
  Command tick() {
    const Command command = robot_->latest();
    robot_->tell(command.arm || stays_on_ ? ArmState::kArmed : ArmState::kDisarmed);
    return command;
  }
  template <class Wanted>
  bool soon(Wanted&& wanted, double seconds = kPatience_s) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!wanted()) {
      tick();
      if (std::chrono::steady_clock::now() > limit) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }
  /// Repeated, as a page does: a busy machine may have stopped the thread for long enough to void one.
  bool asks(double speed_m_s) {
    auto next = std::chrono::steady_clock::now();
    return soon([&] {
      if (std::chrono::steady_clock::now() >= next) {
        say("drive " + std::to_string(speed_m_s) + " 0 0\n");
        next += std::chrono::milliseconds(200);
      }
      return tick().velocity_W_m_s.x() == speed_m_s;
    });
  }
  /// The thread stands still, as under Ctrl-Z, until it is resumed.
  void stop_it() {
    stopped = false;
    resumed = false;
    struct sigaction action {};
    action.sa_handler = [](int) {
      for (stopped = true; !resumed;) usleep(10'000);
    };
    sigaction(SIGUSR1, &action, nullptr);
    pthread_kill(thread_.native_handle(), SIGUSR1);
    ASSERT_TRUE(soon([] { return stopped.load(); }));
  }
  void resume_after(double seconds) {
    soon([] { return false; }, seconds);
    resumed = true;
  }
  /// A request that waits for the wire when the thread is stopped: none that has already been sent.
  template <class Sent>
  bool stop_it_before(const std::string& request, Sent&& sent, const std::string& undo) {
    for (int attempt = 0; attempt < 10; ++attempt) {
      if (!asks(0.1)) return false;
      say(request);
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      stop_it();
      if (!soon(sent, 0.3)) return true;
      resumed = true;
      say(undo);
    }
    return false;
  }

  int robots_ = -1, holders_ = -1;
  int requests_[2] = {-1, -1};
  std::string device_;
  SendArguments arguments_;
  bool stays_on_ = false;  // whatever it is told
  std::unique_ptr<CommandReceiver> robot_;
  std::atomic<bool> found_{false}, returned_{false};
  std::string error_;  // once it has returned
  std::thread thread_;
  static inline std::atomic<bool> stopped{false}, resumed{false};
};

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
