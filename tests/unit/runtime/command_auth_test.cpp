// Only holders of the key command the robot, and no message counts twice.
#include "equipoise/runtime/command_auth.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>

namespace equipoise::runtime {
namespace {

CommandKey key_of(std::uint8_t first) {
  std::array<std::uint8_t, CommandKey::kBytes> bytes{};
  bytes[0] = first;
  return CommandKey(bytes);
}

signed_command_t command_for(const CommandGate& gate, std::int64_t sequence, const CommandKey& key) {
  signed_command_t m{};
  std::memcpy(m.session, gate.session().session, sizeof m.session);
  m.sequence = sequence;
  m.velocity_W_m_s[0] = 0.25;
  m.yaw_rate_rad_s = -1.5;
  m.arm = 1;
  key.sign(&m);
  return m;
}

TEST(CommandGate, TakesWhatTheKeyHolderSends) {
  CommandGate gate(key_of(1));
  Command c;
  ASSERT_TRUE(gate.accept(command_for(gate, 1, key_of(1)), &c));
  EXPECT_EQ(c.velocity_W_m_s.x(), 0.25);
  EXPECT_EQ(c.yaw_rate_rad_s, -1.5);
  EXPECT_TRUE(c.arm);
  EXPECT_FALSE(c.heading_reset);
  EXPECT_TRUE(gate.accept(command_for(gate, 5, key_of(1)), &c));  // lost messages leave gaps
  EXPECT_EQ(gate.session().accepted, 2);
  EXPECT_EQ(gate.session().refused, 0);
}

TEST(CommandGate, TakesNoneOfAThousandForgedOrReplayedCommands) {
  const CommandKey key = key_of(1);
  CommandGate earlier(key);
  CommandGate gate(key);
  Command c;
  std::vector<signed_command_t> heard;
  for (std::int64_t i = 1; i <= 100; ++i) {
    heard.push_back(command_for(gate, i, key));
    ASSERT_TRUE(gate.accept(heard.back(), &c));
  }
  std::mt19937 random(7);
  const auto pick = [&random](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int accepted = 0;
  for (int i = 0; i < 1000; ++i) {
    signed_command_t m = heard[pick(heard.size())];  // 0: replayed as it was
    switch (i % 8) {
      case 1:
        m = command_for(gate, 1000 + i, key_of(2));
        break;  // another key
      case 2:
        m.sequence = 1000 + i;
        break;  // renumbered
      case 3:   // one bit of the mac turned
        m = command_for(gate, 1000 + i, key);
        m.mac[pick(sizeof m.mac)] ^= static_cast<std::uint8_t>(1U << pick(8));
        break;
      case 4:  // content changed
        m = command_for(gate, 1000 + i, key);
        m.velocity_W_m_s[pick(2)] += 0.1;
        break;
      case 5:  // disarmed to armed
        m = command_for(gate, 1000 + i, key);
        m.arm = 0;
        break;
      case 6:
        m = command_for(earlier, 1000 + i, key);
        break;  // recorded in another session
      case 7:   // noise
        for (std::uint8_t& byte : m.mac) byte = static_cast<std::uint8_t>(random());
        m.sequence = 1000 + i;
        break;
      default:
        break;
    }
    accepted += gate.accept(m, &c) ? 1 : 0;
  }
  EXPECT_EQ(accepted, 0);
  EXPECT_EQ(gate.session().refused, 1000);
  EXPECT_EQ(gate.session().accepted, 100);
  EXPECT_TRUE(gate.accept(command_for(gate, 101, key), &c));  // the sender itself is not locked out
}

TEST(CommandGate, RefusesWhatIsSignedButNotFinite) {
  const CommandKey key = key_of(1);
  CommandGate gate(key);
  Command c;
  signed_command_t m = command_for(gate, 1, key);
  m.velocity_W_m_s[1] = std::numeric_limits<double>::quiet_NaN();
  key.sign(&m);
  EXPECT_FALSE(gate.accept(m, &c));
}

TEST(CommandGate, EverySessionIsAnother) {
  const CommandGate a(key_of(1));
  const CommandGate b(key_of(1));
  EXPECT_NE(std::memcmp(a.session().session, b.session().session, sizeof a.session().session), 0);
}

class KeyFile : public ::testing::Test {
 protected:
  KeyFile() : path_("/tmp/equipoise-key-" + std::to_string(getpid())) { std::remove(path_.c_str()); }
  ~KeyFile() override { std::remove(path_.c_str()); }

  std::string complaint() const {
    try {
      CommandKey::load(path_);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "loaded";
  }

  std::string path_;
};

TEST_F(KeyFile, IsMadeForItsOwnerAndNeverOverwritten) {
  CommandKey::create(path_);
  struct stat about {};
  ASSERT_EQ(stat(path_.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 0777U, 0600U);
  EXPECT_EQ(complaint(), "loaded");
  EXPECT_THROW(CommandKey::create(path_), std::runtime_error);
}

TEST_F(KeyFile, ThatOthersMayReadIsRefusedWithTheFix) {
  CommandKey::create(path_);
  for (const mode_t mode : {0640U, 0604U, 0620U, 0666U}) {
    ASSERT_EQ(chmod(path_.c_str(), mode), 0);
    EXPECT_NE(complaint().find("chmod 600 " + path_), std::string::npos) << std::oct << mode;
  }
}

TEST_F(KeyFile, ThatIsNoKeyIsRefused) {
  EXPECT_NE(complaint().find("equipoise keygen"), std::string::npos);  // missing
  for (const std::string& text : {std::string(), std::string("secret\n"), std::string(64, 'g'),
                                 std::string(63, 'a'), std::string(66, 'a')}) {
    std::ofstream(path_) << text;
    ASSERT_EQ(chmod(path_.c_str(), 0600), 0);
    EXPECT_NE(complaint().find("is no key"), std::string::npos) << text;
  }
}

TEST_F(KeyFile, SignsTheSameAfterLoading) {
  CommandKey::create(path_);
  const CommandKey a = CommandKey::load(path_);
  const CommandKey b = CommandKey::load(path_);
  signed_command_t m{};
  m.sequence = 3;
  a.sign(&m);
  EXPECT_TRUE(b.signed_by_it(m));
}

}  // namespace
}  // namespace equipoise::runtime
