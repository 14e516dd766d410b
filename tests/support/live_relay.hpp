// `equipoise send --live` in a thread of its own, and its robot at the other end of serial lines.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <pty.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "app/run/conversation.hpp"
#include "equipoise/runtime/command_receiver.hpp"

namespace equipoise::app {

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

/// The robot's end of its lines, on which it may not hear, or hear the first message late and no other.
class RobotsLines final : public runtime::CommandWire {
 public:
  enum Ear { kHears, kDeaf, kKeepsFirst };
  RobotsLines(const std::vector<int>& lines, const std::atomic<Ear>& ear) : ear_(ear) {
    for (const int fd : lines)
      lines_.push_back(std::make_unique<runtime::StreamWire>(std::make_unique<Terminal>(fd)));
  }
  void listen(int milliseconds, const Received& received) override {
    if (ear_ == kHears && !kept_.empty()) received(kept_.data(), kept_.size());
    if (ear_ == kHears) kept_.clear();
    for (const auto& line : lines_) {
      line->listen(milliseconds / static_cast<int>(lines_.size()),
                   [&](const std::uint8_t* data, std::size_t size) {
                     if (ear_ == kHears) received(data, size);
                     if (ear_ == kKeepsFirst && kept_.empty()) kept_.assign(data, data + size);
                   });
    }
  }
  void say(const std::vector<std::uint8_t>& message) override {
    for (const auto& line : lines_) line->say(message);
  }

 private:
  const std::atomic<Ear>& ear_;
  std::vector<std::unique_ptr<runtime::StreamWire>> lines_;
  std::vector<std::uint8_t> kept_;
};

class Relay : public ::testing::Test {
 protected:
  static constexpr double kPatience_s = 20.0;  // of this test with a busy machine

  void SetUp() override {
    char name[64] = {};
    ASSERT_EQ(openpty(&robots_, &holders_, name, nullptr, nullptr), 0);
    ASSERT_EQ(pipe(requests_), 0);
    device_ = name;
    lines_ = {robots_};
  }
  void TearDown() override {
    end();
    robot_.reset();
    for (const int fd : {robots_, holders_, requests_[0]}) close(fd);
  }

  void start_robot() {
    const auto journal = [this](const std::string& what) { armings_ += what == "owner asks for the motors"; };
    robot_ =
        std::make_unique<CommandReceiver>(keys_, runtime::CommandReceiverOptions{"", kPatience_s, journal},
                                          std::make_unique<RobotsLines>(lines_, ear_));
  }
  /// Returns when a robot has been found. `requests`: from which lines come.
  void start(int baud, int requests, double patience_s = kPatience_s) {
    start_robot();
    arguments_.url = "serial:" + device_ + ":" + std::to_string(baud);
    arguments_.timeout_s = patience_s;
    thread_ = std::thread([this, requests] {
      Conversation conversation(arguments_, keys_);
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

  const CommandKeys keys_ = CommandKeys::of_robot("mbbr", CommandKey({1, 2, 3}));
  int robots_ = -1, holders_ = -1;
  std::vector<int> lines_;  // the robot's ends
  std::atomic<RobotsLines::Ear> ear_{RobotsLines::kHears};
  std::atomic<int> armings_{0};  // that the robot was asked for
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

}  // namespace equipoise::app
