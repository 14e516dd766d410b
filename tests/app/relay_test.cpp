// The lines of `equipoise send --live`, and what a robot at the other end of a serial line makes of them.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <pty.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "app/run/conversation.hpp"
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
  void start(int baud, int requests) {
    const CommandKeys keys = CommandKeys::of_robot("mbbr", CommandKey({1, 2, 3}));
    robot_ = std::make_unique<CommandReceiver>(
        keys, runtime::CommandReceiverOptions{"", kPatience_s, {}},
        std::make_unique<runtime::StreamWire>(std::make_unique<Terminal>(robots_)));
    arguments_.url = "serial:" + device_ + ":" + std::to_string(baud);
    arguments_.timeout_s = kPatience_s;
    thread_ = std::thread([this, keys, requests] {
      Conversation conversation(arguments_, keys);
      conversation.find_robots();
      found_ = true;
      conversation.relay(requests);
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
    robot_->tell(command.arm ? ArmState::kArmed : ArmState::kDisarmed);
    fastest_m_s_ = std::max(fastest_m_s_, command.velocity_W_m_s.x());
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
  bool asks(double speed_m_s) {
    return soon([&] { return tick().velocity_W_m_s.x() == speed_m_s; });
  }
  /// The thread stands still, as under Ctrl-Z.
  void stop_it() {
    struct sigaction action {};
    action.sa_handler = [](int) { usleep(1'400'000); };  // longer than a request lives
    sigaction(SIGUSR1, &action, nullptr);
    pthread_kill(thread_.native_handle(), SIGUSR1);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }

  int robots_ = -1, holders_ = -1;
  int requests_[2] = {-1, -1};
  std::string device_;
  SendArguments arguments_;
  std::unique_ptr<CommandReceiver> robot_;
  std::atomic<bool> found_{false}, returned_{false};
  double fastest_m_s_ = 0.0;
  std::thread thread_;
};

constexpr int kQuick = 115200;
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
  EXPECT_TRUE(asks(0.1));
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

TEST_F(Relay, ALineWithoutEndEndsIt) {
  start(kQuick, requests_[0]);
  const std::string noise(1 << 15, 'x');
  say(noise);
  EXPECT_FALSE(soon([&] { return returned_.load(); }, 0.3));
  say(noise);
  say("x");
  EXPECT_TRUE(soon([&] { return returned_.load(); }));
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
  say("arm\n");
  ASSERT_TRUE(soon([&] { return tick().arm; }));
  say("drive 0.1 0 0\n");
  ASSERT_TRUE(asks(0.1));
  say("drive 0.2 0 0\n");  // has to wait for the wire
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  testing::internal::CaptureStderr();
  stop_it();
  say("drive 0.3 0 0\n");
  EXPECT_FALSE(soon([&] { return tick().velocity_W_m_s.x() > 0.15; }, 3.0));
  EXPECT_NE(testing::internal::GetCapturedStderr().find("what was asked before is void"), std::string::npos);
  say("drive 0.4 0 0\n");  // and goes on with what is asked from then on
  EXPECT_TRUE(asks(0.4));
  stop_it();
  say("disarm\n");
  EXPECT_TRUE(soon([&] { return !tick().arm; })) << "never too late";
}

TEST_F(Relay, AnArmThatWaitsWhileItIsStoppedIsVoid) {
  start(kSlow, requests_[0]);
  say("drive 0.1 0 0\n");
  ASSERT_TRUE(asks(0.1));
  say("arm\n");  // has to wait for the wire
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  stop_it();
  EXPECT_FALSE(soon([&] { return tick().arm; }, 3.0));
}

}  // namespace
}  // namespace equipoise::app
