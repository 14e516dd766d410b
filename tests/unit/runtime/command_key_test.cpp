// Key files are private, name whom they are for, and can be replaced.
#include "equipoise/runtime/command_key.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>

#include "command_fixture.hpp"
#include "support/failing_rename.hpp"
#include "support/file_size_limit.hpp"

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

TEST_F(KeyFile, IsPlainTextOfOneLine) {
  keys_of(0xAB).save(path_);
  std::string text;
  std::getline(std::ifstream(path_), text, '\0');
  EXPECT_EQ(text, "equipoise-key-1 robot mbbr ab" + std::string(62, '0') + "\n");
  std::remove(path_.c_str());
  keys_of(0xAB).of_holder("anna").save(path_);
  std::getline(std::ifstream(path_), text, '\0');
  EXPECT_EQ(text.substr(0, 32), "equipoise-key-1 holder mbbr anna");
  EXPECT_EQ(text.size(), 32U + 2U * 65U + 1U);
}

TEST_F(KeyFile, OfAHolderWithBadNamesIsRefused) {
  const std::string hex(64, 'a');
  for (const std::string names : {"mb/br anna", "mbbr an/na"}) {
    std::ofstream(path_) << "equipoise-key-1 holder " << names << " " << hex << " " << hex << "\n";
    ASSERT_EQ(chmod(path_.c_str(), 0600), 0);
    EXPECT_NE(complaint().find("is no key"), std::string::npos) << names;
  }
}

TEST_F(KeyFile, KeysAreMadeForProperNamesOnly) {
  EXPECT_THROW(CommandKeys::create(path_, "mb br"), std::runtime_error);
  EXPECT_THROW(CommandKeys::load(path_), std::runtime_error) << "and no file is left";
  EXPECT_THROW(keys_of(1).of_holder("an na"), std::runtime_error);
  EXPECT_THROW(keys_of(1, ""), std::runtime_error);
}

TEST_F(KeyFile, IsAFile) {
  ASSERT_EQ(mkdir(path_.c_str(), 0700), 0);
  EXPECT_NE(complaint().find("is no file"), std::string::npos);
  rmdir(path_.c_str());
}

TEST_F(KeyFile, OfAnotherUserIsRefused) {
  CommandKeys::create(path_, "mbbr");
  if (chown(path_.c_str(), 12345, 12345) != 0) GTEST_SKIP() << "needs root";
  EXPECT_NE(complaint().find("belongs to another user"), std::string::npos);
}

TEST_F(KeyFile, ThatCannotBeWrittenIsNotLeftBehind) {
  std::string text;
  try {
    const FileSizeLimit little(8);
    CommandKeys::create(path_, "mbbr");
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  EXPECT_NE(text.find("cannot be written"), std::string::npos) << text;
  EXPECT_NE(access(path_.c_str(), F_OK), 0);
}

TEST_F(KeyFile, ARotationLeavesOtherFilesAlone) {
  CommandKeys::create(path_, "mbbr");
  std::ofstream(path_ + ".new") << "somebody's";
  CommandKeys::rotate(path_);
  EXPECT_EQ(complaint(), "loaded");
  EXPECT_EQ(access((path_ + ".new").c_str(), F_OK), 0);
  unlink((path_ + ".new").c_str());
}

TEST_F(KeyFile, ARotationThroughALinkRenewsTheFile) {
  const std::string link = path_ + ".link";
  CommandKeys::create(path_, "mbbr");
  const CommandKeys old = CommandKeys::load(path_);
  ASSERT_EQ(symlink(path_.c_str(), link.c_str()), 0);
  CommandKeys::rotate(link);
  EXPECT_FALSE(convinces(old, CommandKeys::load(path_), "anna"));
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  unlink(link.c_str());
}

TEST_F(KeyFile, OfTheRobotsUserIsRenewedByRoot) {
  CommandKeys::create(path_, "mbbr");
  if (chown(path_.c_str(), 12345, 12346) != 0) GTEST_SKIP() << "needs root";
  CommandKeys::rotate(path_);
  struct stat about {};
  ASSERT_EQ(stat(path_.c_str(), &about), 0);
  EXPECT_EQ(about.st_uid, 12345U);
  EXPECT_EQ(about.st_gid, 12346U);
  EXPECT_EQ(about.st_mode & 0777U, 0600U);
}

TEST_F(KeyFile, APipeIsNotWaitedFor) {
  ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
  EXPECT_NE(complaint().find("is no file"), std::string::npos);
  unlink(path_.c_str());
}

TEST_F(KeyFile, ARotationThatFailsLeavesTheOldKeyAndNoOther) {
  CommandKeys::create(path_, "mbbr");
  const CommandKeys old = CommandKeys::load(path_);
  std::string text;
  try {
    const FailingRename broken(EIO);
    CommandKeys::rotate(path_);
  } catch (const std::runtime_error& error) {
    text = error.what();
  }
  EXPECT_EQ(text, path_ + ": Input/output error");
  const auto beside = std::filesystem::directory_iterator(std::filesystem::path(path_).parent_path());
  for (const auto& entry : beside)
    EXPECT_NE(entry.path().string().rfind(path_ + ".", 0), 0U)
        << "a key that nobody knows of: " << entry.path();
  EXPECT_TRUE(convinces(old, CommandKeys::load(path_), "anna"));
}

TEST_F(KeyFile, ReadingAndWritingLeaveNoDescriptorOpen) {
  const int first = dup(STDERR_FILENO);
  close(first);
  CommandKeys::create(path_, "mbbr");
  EXPECT_EQ(complaint(), "loaded");
  EXPECT_THROW(CommandKeys::create(path_, "mbbr"), std::runtime_error);
  const int after = dup(STDERR_FILENO);
  EXPECT_EQ(after, first);
  close(after);
}

TEST(CommandKeys, EveryPurposeAndHolderHasAnother) {
  const CommandKeys robot = keys_of(1);
  const std::string announcements = robot.announcements().hex();
  const std::string anna = robot.commands("anna").hex();
  const std::string berta = robot.commands("berta").hex();
  const std::string secret = CommandKey(CommandKey::Bytes{1}).hex();
  EXPECT_EQ((std::set<std::string>{announcements, anna, berta, secret}).size(), 4U);
  EXPECT_EQ(robot.of_holder("anna").commands("anna").hex(), anna);
  EXPECT_EQ(robot.of_holder("anna").announcements().hex(), announcements);
}

TEST(CommandNames, EndWhereTheirLettersEnd) {
  for (const char* good : {"a", "z", "A", "Z", "0", "9"}) EXPECT_TRUE(is_command_name(good)) << good;
  for (const char* bad : {"`", "{", "@", "[", "/", ":"}) EXPECT_FALSE(is_command_name(bad)) << bad;
}

TEST(CommandNames, AreShortAndPlain) {
  for (const char* good : {"a", "mbbr-1", "Anna_B.2", "sixteen-letters-"}) EXPECT_TRUE(is_command_name(good));
  for (const char* bad : {"", "seventeen-letters", "a b", "../x", "ä", "a\n"})
    EXPECT_FALSE(is_command_name(bad)) << bad;
}

}  // namespace
}  // namespace equipoise::runtime
