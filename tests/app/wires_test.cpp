// Commands over a serial line: a pseudo-terminal in the place of the HC-06.
#include "app/run/wires.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <optional>
#include <thread>

#include "app/cli/commands.hpp"
#include "equipoise/runtime/command_receiver.hpp"

namespace equipoise::app {
namespace {

using runtime::CommandKey;
using runtime::WireSide;

class Master final : public runtime::ByteStream {
 public:
  explicit Master(int fd) : fd_(fd) { fcntl(fd_, F_SETFL, O_NONBLOCK); }
  std::size_t read(std::uint8_t* out, std::size_t size) override {
    const ssize_t n = ::read(fd_, out, size);
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    const ssize_t n = ::write(fd_, data, size);
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  double bytes_per_s() const override { return 11520.0; }

 private:
  int fd_;
};

class SerialRemote : public ::testing::Test {
 protected:
  void SetUp() override {
    char name[64] = {};
    ASSERT_EQ(openpty(&master_, &slave_, name, nullptr, nullptr), 0);
    robot_.emplace(key_, open_wire("serial:" + std::string(name) + ":115200", WireSide::kRobot));
    owner_.emplace(std::make_unique<Master>(master_));
    ASSERT_TRUE(heard([](const command_session_t&) { return true; }));
  }
  void TearDown() override {
    robot_.reset();
    close(master_);
    close(slave_);
  }

  /// Until the robot says a session that is as wanted, or five seconds.
  template <class Wanted>
  bool heard(Wanted&& wanted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    bool found = false;
    while (!found && std::chrono::steady_clock::now() < end) {
      owner_->listen(20, [&](const std::uint8_t* data, std::size_t size) {
        const auto length = static_cast<int>(size);
        if (session_.decode(data, 0, length) == length) found = wanted(session_);
      });
    }
    return found;
  }
  signed_command_t command(std::int64_t sequence) const {
    signed_command_t m{};
    std::memcpy(m.session, session_.session, sizeof m.session);
    m.sequence = sequence;
    m.velocity_W_m_s[0] = 0.1;
    m.arm = 1;
    key_.sign(&m);
    return m;
  }
  void say(const signed_command_t& m) { runtime::say(*owner_, m); }

  const CommandKey key_{{1, 2, 3}};
  int master_ = -1;
  int slave_ = -1;
  std::optional<runtime::CommandReceiver> robot_;
  std::optional<runtime::StreamWire> owner_;
  command_session_t session_{};
};

TEST_F(SerialRemote, ObeysTheHolderOfTheKey) {
  EXPECT_FALSE(robot_->latest(0).arm);
  say(command(1));
  ASSERT_TRUE(heard([](const command_session_t& s) { return s.accepted == 1; }));
  const Command obeyed = robot_->latest(5'000'000);
  EXPECT_TRUE(obeyed.arm);
  EXPECT_EQ(obeyed.velocity_W_m_s.x(), 0.1);
  EXPECT_EQ(obeyed.age_s, 0.0);
}

TEST_F(SerialRemote, ASilentRemotesCommandStaysAndGrowsOld) {
  say(command(1));
  ASSERT_TRUE(heard([](const command_session_t& s) { return s.accepted == 1; }));
  (void)robot_->latest(5'000'000);
  const Command old = robot_->latest(905'000'000);
  EXPECT_TRUE(old.arm);
  EXPECT_EQ(old.velocity_W_m_s.x(), 0.1);  // what follows from its age is the safety's business
  EXPECT_DOUBLE_EQ(old.age_s, 0.9);
}

TEST_F(SerialRemote, ARemoteThatNeverSpokeIsOldFromTheStart) {
  (void)robot_->latest(1'000'000'000);
  EXPECT_DOUBLE_EQ(robot_->latest(1'700'000'000).age_s, 0.7);
}

TEST_F(SerialRemote, RefusesForgeriesReplaysAndNoise) {
  say(command(1));
  ASSERT_TRUE(heard([](const command_session_t& s) { return s.accepted == 1; }));
  constexpr int kAttacks = 1000;
  std::int64_t refused = session_.refused;
  for (int i = 0; i < kAttacks; ++i) {
    signed_command_t m = command(i % 2 == 0 ? 1 : 2 + i);
    if (i % 2 != 0) m.mac[i % 32] = static_cast<std::uint8_t>(m.mac[i % 32] ^ (1U << (i % 8)));
    say(m);
    if (i % 16 == 15) {  // let it hear: a pseudo-terminal holds 4 kB
      const std::int64_t sent = refused + i + 1;
      ASSERT_TRUE(heard([&](const command_session_t& s) { return s.refused >= sent; })) << i;
    }
  }
  EXPECT_TRUE(heard([&](const command_session_t& s) { return s.refused >= refused + kAttacks; }));
  EXPECT_EQ(session_.accepted, 1);
}

TEST(Wires, NamesWhatItCannotOpen) {
  const auto complaint = [](const std::string& name) -> std::string {
    try {
      open_wire(name, WireSide::kOwner);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(complaint("serial:/dev/no-such-line:9600"), ::testing::HasSubstr("/dev/no-such-line"));
  EXPECT_THAT(complaint("serial:/dev/null"), ::testing::HasSubstr("serial:DEVICE:BAUD"));
  EXPECT_THAT(complaint("serial:/dev/null:12"), ::testing::HasSubstr("1200 to 115200"));
  EXPECT_THAT(complaint("can:no-such-bus"), ::testing::HasSubstr("no-such-bus"));
}

}  // namespace
}  // namespace equipoise::app
