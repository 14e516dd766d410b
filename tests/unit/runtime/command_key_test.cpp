// Key files are private, name whom they are for, and can be replaced.
#include "equipoise/runtime/command_key.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "command_fixture.hpp"

namespace equipoise::runtime {
namespace {

class KeyFile : public ::testing::Test {
 protected:
  KeyFile() : path_("/tmp/equipoise-key-" + std::to_string(getpid())) { std::remove(path_.c_str()); }
  ~KeyFile() override {
    std::remove(path_.c_str());
    std::remove((path_ + ".anna").c_str());
  }

  std::string complaint() const {
    try {
      CommandKeys::load(path_);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "loaded";
  }
  /// A message by `writer` convinces a robot with `reader`.
  static bool convinces(const CommandKeys& writer, const CommandKeys& reader, const std::string& holder) {
    signed_command_t m{};
    set_name(holder, &m.holder);
    sign(writer, "mbbr", &m);
    return authentic(reader, "mbbr", m);
  }

  std::string path_;
};

TEST_F(KeyFile, IsMadeForItsOwnerAndNeverOverwritten) {
  CommandKeys::create(path_, "mbbr");
  struct stat about {};
  ASSERT_EQ(stat(path_.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 0777U, 0600U);
  EXPECT_EQ(complaint(), "loaded");
  EXPECT_EQ(CommandKeys::load(path_).robot(), "mbbr");
  EXPECT_THROW(CommandKeys::create(path_, "mbbr"), std::runtime_error);
}

TEST_F(KeyFile, ThatOthersMayReadIsRefusedWithTheFix) {
  CommandKeys::create(path_, "mbbr");
  for (const mode_t mode : {0640U, 0604U, 0620U, 0666U}) {
    ASSERT_EQ(chmod(path_.c_str(), mode), 0);
    EXPECT_NE(complaint().find("chmod 600 " + path_), std::string::npos) << std::oct << mode;
  }
}

TEST_F(KeyFile, ThatIsNoKeyIsRefused) {
  EXPECT_NE(complaint().find("equipoise keygen"), std::string::npos);  // missing
  const std::string hex(64, 'a');
  for (const std::string& text :
       {std::string(), std::string("secret\n"), hex, "equipoise-key-1 robot mbbr " + hex.substr(1),
        "equipoise-key-1 robot mbbr " + hex + "a", "equipoise-key-1 robot mbbr " + std::string(64, 'g'),
        "equipoise-key-1 robot mb/br " + hex, "equipoise-key-1 holder mbbr anna " + hex,
        "equipoise-key-2 robot mbbr " + hex, "equipoise-key-1 robot mbbr " + hex + " more"}) {
    std::ofstream(path_) << text;
    ASSERT_EQ(chmod(path_.c_str(), 0600), 0);
    EXPECT_NE(complaint().find("is no key"), std::string::npos) << text;
  }
}

TEST_F(KeyFile, SignsTheSameAfterLoading) {
  CommandKeys::create(path_, "mbbr");
  EXPECT_TRUE(convinces(CommandKeys::load(path_), CommandKeys::load(path_), "anna"));
}

TEST_F(KeyFile, OfAHolderSpeaksForThatHolderOnly) {
  const CommandKeys robot = keys_of(1);
  robot.of_holder("anna").save(path_);
  const CommandKeys anna = CommandKeys::load(path_);
  EXPECT_EQ(anna.holder(), "anna");
  EXPECT_EQ(anna.robot(), "mbbr");
  EXPECT_TRUE(convinces(anna, robot, "anna"));
  EXPECT_THROW(convinces(anna, robot, "berta"), std::runtime_error);
  EXPECT_THROW(anna.of_holder("berta"), std::runtime_error);
  EXPECT_FALSE(convinces(keys_of(2).of_holder("anna"), robot, "anna"));
  command_session_t said{};
  sign(robot, &said);
  EXPECT_TRUE(authentic(anna, said));
}

TEST_F(KeyFile, AfterARotationOldKeysAreWorthless) {
  CommandKeys::create(path_, "mbbr");
  const CommandKeys old = CommandKeys::load(path_);
  CommandKeys::rotate(path_);
  const CommandKeys now = CommandKeys::load(path_);
  EXPECT_EQ(now.robot(), "mbbr");
  EXPECT_FALSE(convinces(old, now, "anna"));
  EXPECT_FALSE(convinces(old.of_holder("anna"), now, "anna"));
  EXPECT_TRUE(convinces(now, now, "anna"));
  now.of_holder("anna").save(path_ + ".anna");
  EXPECT_THROW(CommandKeys::rotate(path_ + ".anna"), std::runtime_error);
}

TEST(CommandNames, AreShortAndPlain) {
  for (const char* good : {"a", "mbbr-1", "Anna_B.2", "sixteen-letters-"}) EXPECT_TRUE(is_command_name(good));
  for (const char* bad : {"", "seventeen-letters", "a b", "../x", "ä", "a\n"})
    EXPECT_FALSE(is_command_name(bad)) << bad;
}

}  // namespace
}  // namespace equipoise::runtime
