// The receiver on a wire in memory: its clock, its announcements, what it obeys and what it notes. Waits are
// lower bounds or for something to happen: a slow machine makes them longer, not wrong.
#include "equipoise/runtime/command_receiver.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "command_fixture.hpp"
#include "equipoise/runtime/command_sender.hpp"

namespace equipoise::runtime {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

/// What both ends of the wire in memory share.
struct Line {
  std::mutex mutex;
  std::condition_variable news;
  std::deque<Bytes> to_robot;
  std::deque<command_session_t> from_robot;
};

class MemoryWire final : public CommandWire {
 public:
  MemoryWire(Line* line, double interval_s) : line_(line), interval_s_(interval_s) {}
  void listen(int milliseconds, const Received& received) override {
    std::unique_lock lock(line_->mutex);
    line_->news.wait_for(lock, std::chrono::milliseconds(milliseconds),
                         [this] { return !line_->to_robot.empty(); });
    if (line_->to_robot.empty()) return;
    const Bytes message = line_->to_robot.front();
    line_->to_robot.pop_front();
    lock.unlock();
    received(message.data(), message.size());
  }
  void say(const Bytes& message) override {
    command_session_t said;
    const auto size = static_cast<int>(message.size());
    ASSERT_EQ(said.decode(message.data(), 0, size), size);
    const std::lock_guard lock(line_->mutex);
    line_->from_robot.push_back(said);
    line_->news.notify_all();
  }
  double interval_s() const override { return interval_s_; }

 private:
  Line* line_;
  double interval_s_;
};

class Receiver : public ::testing::Test {
 protected:
  void start(double timeout_s = 3600.0, double interval_s = 0.05) {
    CommandReceiverOptions options;
    options.timeout_s = timeout_s;
    options.journal = [this](const std::string& what) {
      const std::lock_guard lock(line_.mutex);
      journal_.push_back(what);
    };
    began_ = std::chrono::steady_clock::now();
    robot_ =
        std::make_unique<CommandReceiver>(keys_, options, std::make_unique<MemoryWire>(&line_, interval_s));
  }
  double elapsed_ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began_).count();
  }
  /// The next thing the robot says.
  command_session_t next() {
    std::unique_lock lock(line_.mutex);
    EXPECT_TRUE(line_.news.wait_for(lock, 60s, [this] { return !line_.from_robot.empty(); }));
    const command_session_t said = line_.from_robot.front();
    line_.from_robot.pop_front();
    return said;
  }
  command_session_t next_to(std::int64_t to) {
    for (;;) {
      const command_session_t said = next();
      if (said.to == to) return said;
    }
  }
  void say(const Bytes& bytes) {
    const std::lock_guard lock(line_.mutex);
    line_.to_robot.push_back(bytes);
    line_.news.notify_all();
  }
  signed_command_t command(std::int8_t action) {
    return sender_.sign(&link(), link().turn, action, {{0.1, 0.2}, 0.3});
  }
  CommandSender::Link& link() { return sender_.links().front(); }
  /// Says it and hears the answer.
  command_session_t ask(const signed_command_t& m) {
    say(encoded(m));
    const command_session_t answer = next_to(m.sender);
    sender_.hear(answer);
    return answer;
  }
  void meet() {
    sender_.hear(next());
    const auto question = sender_.ask();
    ASSERT_TRUE(question);
    ask(*question);
    ASSERT_EQ(sender_.links().size(), 1U);
  }
  std::vector<std::string> journal() {
    const std::lock_guard lock(line_.mutex);
    return journal_;
  }

  const CommandKeys keys_ = keys_of(1);
  Line line_;
  CommandSender sender_{keys_, "", "anna"};
  std::vector<std::string> journal_;
  std::chrono::steady_clock::time_point began_;
  std::unique_ptr<CommandReceiver> robot_;
};

TEST_F(Receiver, ItsClockBeginsWithIt) {
  start();
  const command_session_t first = next();
  EXPECT_GE(first.clock_ms, 0);
  EXPECT_LE(static_cast<double>(first.clock_ms), elapsed_ms());
  const command_session_t second = next();
  EXPECT_LE(static_cast<double>(second.clock_ms), elapsed_ms());
  EXPECT_GE(second.clock_ms - first.clock_ms, 95) << "ten announcements a second, no more";
  EXPECT_EQ(first.to, 0);
  EXPECT_EQ(name_in(first.robot), "mbbr");
}

TEST_F(Receiver, LeavesHalfOfASlowWireToAnswers) {
  start(3600.0, 0.1);
  const std::int64_t first = next().clock_ms;
  EXPECT_GE(next().clock_ms - first, 195);
}

TEST_F(Receiver, AnswersTheSenderAndHandsItsWishToTheTick) {
  start();
  meet();
  const signed_command_t drive = command(signed_command_t::DRIVE);
  const command_session_t answer = ask(drive);
  EXPECT_EQ(answer.sequence, drive.sequence);
  EXPECT_EQ(answer.accepted, 2);
  const Command now = robot_->latest();
  EXPECT_EQ(now.velocity_W_m_s, Vec2(0.1, 0.2));
  EXPECT_EQ(now.yaw_rate_rad_s, 0.3);
  EXPECT_GE(now.age_s, 0.0);
  EXPECT_LE(now.age_s, 1e-3 * elapsed_ms());
  EXPECT_EQ(journal(), std::vector<std::string>{}) << "motion is not noted";
}

TEST_F(Receiver, SaysOnlyWhatTheLoopHasDoneInThisTurn) {
  start();
  meet();
  EXPECT_EQ(ask(command(signed_command_t::ARM)).state, +command_session_t::WAITING);
  EXPECT_TRUE(robot_->latest().arm);
  robot_->tell(ArmState::kArmed);
  EXPECT_EQ(ask(command(signed_command_t::DRIVE)).state, +command_session_t::ARMED);
  EXPECT_EQ(ask(command(signed_command_t::DISARM)).state, +command_session_t::WAITING);
  EXPECT_FALSE(robot_->latest().arm);
  robot_->tell(ArmState::kDisarmed);
  EXPECT_EQ(ask(command(signed_command_t::DRIVE)).state, +command_session_t::OFF);
  EXPECT_EQ(ask(command(signed_command_t::ARM)).state, +command_session_t::WAITING);
  (void)robot_->latest();
  robot_->tell(ArmState::kFault);
  EXPECT_EQ(ask(command(signed_command_t::DRIVE)).state, +command_session_t::FAULT);
}

TEST_F(Receiver, NotesWhoBeganWhichTurn) {
  start();
  meet();
  for (const std::int8_t action :
       {signed_command_t::ARM, signed_command_t::DISARM, signed_command_t::HEADING_RESET})
    ask(command(action));
  // The answer goes out before the note.
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (journal().size() < 3 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  EXPECT_EQ(journal(), (std::vector<std::string>{"anna asks for the motors", "anna disarms",
                                                 "anna resets the heading"}));
}

TEST_F(Receiver, WhatIsRefusedOrNoMessageGetsNoAnswer) {
  start();
  meet();
  signed_command_t forged = command(signed_command_t::ARM);
  forged.mac[0] ^= 1;
  Bytes torn = encoded(command(signed_command_t::ARM));
  torn.pop_back();
  Bytes longer = encoded(command(signed_command_t::ARM));
  longer.push_back(0);
  Bytes far_too_long = encoded(command(signed_command_t::ARM));
  far_too_long.resize(70000);
  say(encoded(forged));
  say(torn);
  say(longer);
  say(far_too_long);
  say({});
  const signed_command_t good = command(signed_command_t::DRIVE);
  say(encoded(good));
  const command_session_t answer = next_to(good.sender);
  EXPECT_EQ(answer.sequence, good.sequence) << "the first answer is the good one's";
  EXPECT_EQ(answer.refused, 1);
  EXPECT_EQ(answer.accepted, 2);
  EXPECT_FALSE(robot_->latest().arm);
}

TEST_F(Receiver, AnAnswerToAnOldAnnouncementIsRefused) {
  start(0.1);
  sender_.hear(next());
  const auto question = sender_.ask();
  std::this_thread::sleep_for(150ms);
  say(encoded(*question));
  std::int64_t refused = 0;
  for (int i = 0; i < 100 && refused == 0; ++i) refused = next().refused;
  EXPECT_EQ(refused, 1);
}

/// A line that has bytes when told so, takes `room` of them at a time, and nothing every other time.
class ScriptedStream final : public ByteStream {
 public:
  std::size_t read(std::uint8_t* out, std::size_t size) override {
    if (portions.empty()) return 0;
    Bytes& portion = portions.front();
    const std::size_t count = std::min(size, portion.size());
    std::copy_n(portion.begin(), count, out);
    portion.erase(portion.begin(), portion.begin() + static_cast<std::ptrdiff_t>(count));
    if (portion.empty()) portions.pop_front();
    return count;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    if (++writes % 2 == 0) return 0;
    const std::size_t count = std::min(size, room);
    taken.insert(taken.end(), data, data + count);
    return count;
  }
  double bytes_per_s() const override { return rate; }

  std::deque<Bytes> portions;
  Bytes taken;
  std::size_t room = 10;
  int writes = 0;
  double rate = 11520.0;
};

class OnAStream : public ::testing::Test {
 protected:
  OnAStream() : OnAStream(std::make_unique<ScriptedStream>()) {}
  explicit OnAStream(std::unique_ptr<ScriptedStream> stream) : line_(*stream), wire_(std::move(stream)) {}
  std::vector<Bytes> heard(int milliseconds) {
    std::vector<Bytes> messages;
    wire_.listen(milliseconds, [&](const std::uint8_t* data, std::size_t size) {
      messages.emplace_back(data, data + size);
    });
    return messages;
  }
  const Bytes message_ = Bytes(100, 7);

  ScriptedStream& line_;
  StreamWire wire_;
};

TEST_F(OnAStream, AWholeFrameIsSaidThroughALineThatTakesLittleAtATime) {
  wire_.say(message_);
  EXPECT_EQ(line_.taken, to_frame(message_.data(), message_.size()));
}

TEST_F(OnAStream, ADeadLineIsGivenUpSoon) {
  line_.room = 0;
  wire_.say(message_);
  EXPECT_TRUE(line_.taken.empty());
  EXPECT_EQ(line_.writes, 100) << "a millisecond each";
}

TEST_F(OnAStream, AMessageInPortionsIsHeardOnceItIsWhole) {
  const Bytes frame = to_frame(message_.data(), message_.size());
  line_.portions = {Bytes(frame.begin(), frame.begin() + 40), Bytes(frame.begin() + 40, frame.end())};
  EXPECT_EQ(heard(60'000), std::vector<Bytes>{message_});  // at once, not after a minute
}

TEST_F(OnAStream, SilenceEndsWithTheTime) {
  const auto before = std::chrono::steady_clock::now();
  EXPECT_TRUE(heard(20).empty());
  EXPECT_GE(std::chrono::steady_clock::now() - before, 20ms);
}

TEST_F(OnAStream, ASlowLineAsksForLongerIntervals) {
  EXPECT_DOUBLE_EQ(wire_.interval_s(), 0.05);
  line_.rate = 640.0;
  EXPECT_DOUBLE_EQ(wire_.interval_s(), 0.2);  // 128 bytes a command
}

TEST(LcmWire, CarriesCommandsOneWayAndSessionsTheOther) {
  const std::string url = "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  std::unique_ptr<CommandWire> robot;
  std::unique_ptr<CommandWire> owner;
  try {
    robot = open_lcm_wire(url, WireSide::kRobot);
    owner = open_lcm_wire(url, WireSide::kOwner);
  } catch (const std::runtime_error& error) {
    GTEST_SKIP() << error.what();
  }
  const auto passes = [](CommandWire& from, CommandWire& to, const Bytes& message) {
    std::vector<Bytes> heard;
    const auto received = [&](const std::uint8_t* data, std::size_t size) {
      heard.emplace_back(data, data + size);
    };
    from.say(message);
    for (int i = 0; i < 100 && heard.empty(); ++i) to.listen(50, received);
    from.listen(1, [](const std::uint8_t*, std::size_t) { ADD_FAILURE() << "hears itself"; });
    return heard == std::vector<Bytes>{message};
  };
  EXPECT_TRUE(passes(*owner, *robot, {1, 2, 3}));
  EXPECT_TRUE(passes(*robot, *owner, {4, 5}));
}

TEST(LcmWire, NamesTheUrlThatItCannotOpen) {
  std::string text;
  try {
    open_lcm_wire("nothing://here", WireSide::kRobot);
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  EXPECT_NE(text.find("nothing://here"), std::string::npos) << text;
}

}  // namespace
}  // namespace equipoise::runtime
