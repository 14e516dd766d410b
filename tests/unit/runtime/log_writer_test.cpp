#include "runtime/log_writer.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "equipoise/runtime/log_parts.hpp"

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class LogWriterTest : public testing::Test {
 protected:
  LogWriterTest() {
    char name[] = "/tmp/equipoise-log-XXXXXX";
    folder_ = mkdtemp(name);
    path_ = (folder_ / "run.lcm").string();
  }
  ~LogWriterTest() override { fs::remove_all(folder_); }

  // Two events of 100 bytes.
  static void write_tick(LogWriter* log) {
    log->event(0, "CHANNEL1", std::vector<std::uint8_t>(100 - 28 - 8));
    log->event(0, "CHANNEL2", std::vector<std::uint8_t>(100 - 28 - 8));
    log->end_tick();
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }

  fs::path folder_;
  std::string path_;
};

TEST_F(LogWriterTest, ATickReachesTheFileWholeAndAtOnce) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  for (std::uintmax_t tick = 0; tick < 3; ++tick) {
    log.event(0, "CHANNEL1", std::vector<std::uint8_t>(64));
    EXPECT_EQ(fs::file_size(path_), tick * 200);
    log.event(0, "CHANNEL2", std::vector<std::uint8_t>(64));
    log.end_tick();
    EXPECT_EQ(fs::file_size(path_), (tick + 1) * 200);
  }
}

TEST_F(LogWriterTest, ADiskThatFillsUpInsideATickCostsTheWholeTick) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, SIG_IGN);
  const rlimit small{550, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  for (int tick = 0; tick < 5; ++tick) write_tick(&log);
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, SIG_DFL);
  EXPECT_FALSE(log.is_open());
  EXPECT_THAT(log.error(), HasSubstr("log stopped: File too large"));
  EXPECT_EQ(fs::file_size(path_), 400U);
}

TEST_F(LogWriterTest, ALogOfTheSameNameIsReplacedWithAllItsPartsOrKept) {
  for (const char* name :
       {"run.lcm", "run.0001.lcm", "run.12345.lcm", "run.001.lcm", "run.x.lcm", "runs.lcm"})
    write(name, "old");
  LogWriter log;
  LogLimits limits;
  limits.keep_previous = true;
  ASSERT_TRUE(log.open(path_, limits));
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(path_));
  const std::vector<std::string> kept = kept_logs(path_);
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_THAT(existing_log_parts(kept[0]),
              ElementsAre(kept[0], log_part(kept[0], 1), log_part(kept[0], 12345)));
  EXPECT_TRUE(fs::exists(folder_ / "run.x.lcm") && fs::exists(folder_ / "run.001.lcm"));
  log.close();

  write("run.0001.lcm", "old");
  LogWriter again;
  ASSERT_TRUE(again.open(path_, {}));
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(path_));
  EXPECT_EQ(kept_logs(path_).size(), 3U);
  EXPECT_EQ(fs::file_size(path_), 0U);
}

TEST_F(LogWriterTest, ALogWhoseFurtherPartSomebodyWritesIsNotTaken) {
  write("run.lcm", "first");
  write("run.0001.lcm", "second");
  const int writer = open((folder_ / "run.0001.lcm").c_str(), O_WRONLY);
  ASSERT_EQ(flock(writer, LOCK_EX | LOCK_NB), 0);
  LogWriter log;
  EXPECT_FALSE(log.open(path_, {}));
  EXPECT_THAT(log.error(), HasSubstr("another process is writing it"));
  EXPECT_EQ(fs::file_size(path_), 5U);
  close(writer);
  LogWriter free;
  EXPECT_TRUE(free.open(path_, {}));
}

TEST_F(LogWriterTest, KeptLogsGoBeforeTheRunsOwnFilesWhenSpaceIsShort) {
  write("run.20200101T000000Z.lcm", "oldest");
  write("run.20210101T000000Z.lcm", "old");
  LogWriter log;
  LogLimits limits;
  limits.min_free_bytes = std::int64_t{1} << 60;  // no disk has as much
  ASSERT_TRUE(log.open(path_, limits));
  write_tick(&log);
  EXPECT_TRUE(kept_logs(path_).empty());
  EXPECT_THAT(log.error(), HasSubstr("No space left"));
  EXPECT_EQ(fs::file_size(path_), 200U);
}

TEST_F(LogWriterTest, APreambleStartsEveryFile) {
  LogWriter log;
  LogLimits limits;
  limits.max_bytes = 400;
  limits.sync = true;
  ASSERT_TRUE(log.open(path_, limits));
  log.preamble(7, "RUN", {1, 2, 3});
  for (int tick = 0; tick < 5; ++tick) write_tick(&log);
  log.close();
  ASSERT_EQ(existing_log_parts(path_).size(), 3U);
  EXPECT_EQ(fs::file_size(path_), 34U + 2 * 200U);
  EXPECT_EQ(fs::file_size(log_part(path_, 1)), 34U + 2 * 200U);
  EXPECT_EQ(fs::file_size(log_part(path_, 2)), 34U + 200U);
}

}  // namespace
}  // namespace equipoise::runtime
