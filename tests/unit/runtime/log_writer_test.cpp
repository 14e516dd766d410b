#include "runtime/log_writer.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "equipoise/runtime/log_parts.hpp"
#include "support/log_folder.hpp"

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class LogWriterTest : public LogFolder {
 protected:
  // Two events of 100 bytes.
  static void write_tick(LogWriter* log) {
    log->event(0, "CHANNEL1", std::vector<std::uint8_t>(100 - 28 - 8));
    log->event(0, "CHANNEL2", std::vector<std::uint8_t>(100 - 28 - 8));
    log->end_tick();
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
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

TEST_F(LogWriterTest, TicksBehindWhichOthersWaitAreWrittenTogether) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  const std::vector<std::uint8_t> data(1000 - 28 - 8);
  int ticks = 0;
  for (; fs::file_size(path_) == 0; ++ticks) {
    log.event(0, "CHANNEL1", data);
    log.end_tick(ticks != 2);
  }
  EXPECT_EQ(fs::file_size(path_), 3000) << "none waits behind the third";
  for (ticks = 0; fs::file_size(path_) == 3000; ++ticks) {
    log.event(0, "CHANNEL1", data);
    log.end_tick(true);
  }
  EXPECT_EQ(ticks, 17) << "16 kB are enough";
}

TEST_F(LogWriterTest, ALogOfTheSameNameIsReplacedWithAllItsPartsOrKept) {
  for (const char* name :
       {"run.lcm", "run.0001.lcm", "run.12345.lcm", "run.001.lcm", "run.x.lcm", "runs.lcm"})
    write(name, log_head(1));
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

  write("run.0001.lcm", log_head(1));
  LogWriter again;
  ASSERT_TRUE(again.open(path_, {}));
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(path_));
  EXPECT_EQ(kept_logs(path_).size(), 3U);
  EXPECT_EQ(fs::file_size(path_), 0U);
}

TEST_F(LogWriterTest, ALogWhoseFurtherPartSomebodyWritesIsNotTaken) {
  write("run.lcm", log_head(0));
  write("run.0001.lcm", log_head(1));
  const int writer = open((folder_ / "run.0001.lcm").c_str(), O_WRONLY);
  ASSERT_EQ(flock(writer, LOCK_EX | LOCK_NB), 0);
  LogWriter log;
  EXPECT_FALSE(log.open(path_, {}));
  EXPECT_THAT(log.error(), HasSubstr("another process is writing it"));
  EXPECT_EQ(fs::file_size(path_), 12U);
  close(writer);
  LogWriter free;
  EXPECT_TRUE(free.open(path_, {}));
}

TEST_F(LogWriterTest, AnEventIsWhatLcmsLogsHold) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  log.event(1, "A", {0xAA});
  log.event(0x0102030405060708, "CH", {0xBB, 0xCC, 0xDD});
  log.end_tick();
  std::string bytes;
  std::getline(std::ifstream(path_, std::ios::binary), bytes, '\n');
  const auto text = [](const char* literal, std::size_t size) { return std::string(literal, size); };
  // sync, event number, time in us, lengths of channel and data
  EXPECT_EQ(bytes, text("\xED\xA1\xDA\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\1\0\0\0\1\0\0\0\1"
                        "A\xAA",
                        30) +
                       text("\xED\xA1\xDA\x01\0\0\0\0\0\0\0\1\1\2\3\4\5\6\7\x8\0\0\0\2\0\0\0\3"
                            "CH\xBB\xCC\xDD",
                            33));
}

TEST_F(LogWriterTest, WithoutAFileNothingIsWritten) {
  LogWriter log;
  EXPECT_FALSE(log.is_open());
  write_tick(&log);
  log.close();
  EXPECT_FALSE(log.open((folder_ / "none" / "run.lcm").string(), {}));
  EXPECT_THAT(log.error(), HasSubstr("none/run.lcm: log cannot be created: No such file or directory"));
  EXPECT_FALSE(log.is_open());
  write_tick(&log);
}

TEST_F(LogWriterTest, ADeviceMayTakeTheLog) {
  LogWriter log;
  EXPECT_TRUE(log.open("/dev/null", {})) << log.error();
  write_tick(&log);
  EXPECT_TRUE(log.is_open());
  LogWriter full;
  ASSERT_TRUE(full.open("/dev/full", {}));
  write_tick(&full);
  EXPECT_THAT(full.error(), HasSubstr("log stopped: No space left on device"));
}

TEST_F(LogWriterTest, EverybodyMayReadALogAndItsOwnerWritesIt) {
  const mode_t before = umask(0);
  LogWriter log;
  EXPECT_TRUE(log.open(path_, {}));
  umask(before);
  struct stat about {};
  ASSERT_EQ(stat(path_.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 07777U, 0644U);
}

TEST_F(LogWriterTest, AnEventMayBeLargerThanAllBeforeIt) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  constexpr std::size_t kHead = 28 + 1;  // with the channel
  std::size_t at = 0;
  for (const std::size_t size : {1U, 100U, 5000U, 300000U, 7U}) {
    log.event(0, "C", std::vector<std::uint8_t>(size, 'x'));
    log.event(0, "D", {});
    log.end_tick();
    std::ifstream file(path_, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(file)), {});
    ASSERT_EQ(whole.size(), at + 2 * kHead + size);
    EXPECT_TRUE(whole.substr(at + kHead - 1, 1 + size) == "C" + std::string(size, 'x')) << size;
    EXPECT_EQ(whole.back(), 'D');
    at = whole.size();
  }
}

TEST_F(LogWriterTest, AKeptLogIsNamedAfterTheEndOfItsLastPart) {
  constexpr timespec kEnds[] = {{1795311000, 0}, {1795311903, 0}};  // the second: 2026-11-22 01:45:03 UTC
  int part = 0;
  for (const char* name : {"run.lcm", "run.0001.lcm"}) {
    write(name, log_head(1));
    const timespec times[] = {kEnds[part], kEnds[part]};
    ASSERT_EQ(utimensat(AT_FDCWD, (folder_ / name).c_str(), times, 0), 0);
    ++part;
  }
  LogWriter log;
  LogLimits limits;
  limits.keep_previous = true;
  ASSERT_TRUE(log.open(path_, limits));
  EXPECT_THAT(kept_logs(path_), ElementsAre((folder_ / "run.20261122T014503Z.lcm").string(),
                                            (folder_ / "run.20261122T014503Z.0001.lcm").string()));
}

TEST_F(LogWriterTest, AnotherProcessFindsTheLogLockedUntilItIsClosed) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  LogWriter second;
  EXPECT_FALSE(second.open(path_, {}));
  EXPECT_THAT(second.error(), HasSubstr("another process is writing it"));
  log.close();
  EXPECT_FALSE(log.is_open());
  LogWriter third;
  EXPECT_TRUE(third.open(path_, {}));
}

TEST_F(LogWriterTest, WhatWasNotYetWrittenIsWrittenAtTheEnd) {
  {
    LogWriter log;
    ASSERT_TRUE(log.open(path_, {}));
    log.event(0, "CHANNEL1", std::vector<std::uint8_t>(64));
  }
  EXPECT_EQ(fs::file_size(path_), 100U);
}

TEST_F(LogWriterTest, AFileIsFullWhenItHasReachedItsSize) {
  LogWriter log;
  LogLimits limits;
  limits.max_bytes = 200;
  ASSERT_TRUE(log.open(path_, limits));
  for (int tick = 0; tick < 2; ++tick) write_tick(&log);
  log.close();
  EXPECT_EQ(fs::file_size(path_), 200U);
  EXPECT_EQ(fs::file_size(log_part(path_, 1)), 28U + 200U) << "with the empty preamble";
  EXPECT_EQ(existing_log_parts(path_).size(), 3U) << "the next is begun at once";
}

TEST_F(LogWriterTest, AFurtherPartThatExistsIsNeitherOverwrittenNorInTheWay) {
  LogWriter log;
  LogLimits limits;
  limits.max_bytes = 200;
  ASSERT_TRUE(log.open(path_, limits));
  write("run.0001.lcm", "somebody's");
  write_tick(&log);
  EXPECT_TRUE(log.is_open()) << log.error();
  EXPECT_EQ(fs::file_size(log_part(path_, 1)), 10U);
  EXPECT_EQ(fs::file_size(log_part(path_, 2)), 28U) << "the empty preamble";
}

TEST_F(LogWriterTest, WhatIsNoLogIsNotReplaced) {
  for (const bool keep : {false, true}) {
    write("run.lcm", "[robot]\n");
    LogWriter log;
    LogLimits limits;
    limits.keep_previous = keep;
    EXPECT_FALSE(log.open(path_, limits));
    EXPECT_THAT(log.error(), HasSubstr("exists and is no log"));
    EXPECT_EQ(fs::file_size(path_), 8U);
  }
}

TEST_F(LogWriterTest, ALogOfOneNameLeavesLogsOfOthersAlone) {
  write("run.20261122.lcm", log_head(0));
  write("run.2024.lcm", "notes");
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  EXPECT_TRUE(fs::exists(folder_ / "run.20261122.lcm") && fs::exists(folder_ / "run.2024.lcm"));
}

TEST_F(LogWriterTest, ShortOfSpaceItDeletesOnlyWhatItWrote) {
  write("run.20261122T014503Z.lcm", log_head(0));
  write("run.20261122T014503Z-keep-best.lcm", log_head(0));
  LogWriter log;
  LogLimits limits;
  limits.max_bytes = 200;
  ASSERT_TRUE(log.open(path_, limits));
  write("run.0001.lcm", "somebody's");
  write_tick(&log);  // goes on in part 2
  log.close();
  limits.min_free_bytes = std::numeric_limits<std::int64_t>::max();
  limits.max_bytes = 0;
  LogWriter short_of_space;
  limits.keep_previous = true;
  ASSERT_TRUE(short_of_space.open(path_, limits));
  write_tick(&short_of_space);
  EXPECT_THAT(short_of_space.error(), HasSubstr("No space"));
  EXPECT_TRUE(fs::exists(folder_ / "run.20261122T014503Z-keep-best.lcm"));
  EXPECT_FALSE(fs::exists(folder_ / "run.20261122T014503Z.lcm"));
  EXPECT_EQ(fs::file_size(log_part(path_, 1)), 10U);
}

TEST_F(LogWriterTest, ALogThatIsDeletedWhileItIsWrittenIsNoSuccess) {
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {}));
  write_tick(&log);
  fs::remove(path_);
  log.close();
  EXPECT_THAT(log.error(), HasSubstr("run.lcm: the log was deleted while it was written"));
}

TEST_F(LogWriterTest, LeavesNoDescriptorOpen) {
  const int first = dup(STDERR_FILENO);
  close(first);
  for (int i = 0; i < 2; ++i) {
    LogWriter log;
    LogLimits limits;
    limits.max_bytes = 200;
    limits.sync = true;
    ASSERT_TRUE(log.open(path_, limits));
    for (int tick = 0; tick < 3; ++tick) write_tick(&log);
    LogWriter second;
    EXPECT_FALSE(second.open(path_, {}));
  }
  const int after = dup(STDERR_FILENO);
  EXPECT_EQ(after, first);
  close(after);
}

TEST_F(LogWriterTest, DescriptorZeroIsOneLikeAnyOther) {
  write("run.lcm", log_head(0) + "of an earlier run");
  const int kept = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3);
  close(STDIN_FILENO);
  LogWriter log;
  EXPECT_TRUE(log.open(path_, {})) << log.error();
  write_tick(&log);
  log.close();
  EXPECT_EQ(log.error(), "");
  EXPECT_EQ(fcntl(STDIN_FILENO, F_GETFD), -1) << "neither the earlier log nor this one holds it";
  dup2(kept, STDIN_FILENO);
  close(kept);
  EXPECT_EQ(fs::file_size(path_), 200U);
}

TEST_F(LogWriterTest, APreambleStartsEveryFile) {
  LogWriter log;
  LogLimits limits;
  limits.max_bytes = 400;
  limits.sync = true;
  ASSERT_TRUE(log.open(path_, limits));
  log.preamble(7, "RUN", {1, 2, 3});
  EXPECT_EQ(fs::file_size(path_), 34U) << "at once: a run that never ticks has one";
  for (int tick = 0; tick < 5; ++tick) write_tick(&log);
  log.close();
  ASSERT_EQ(existing_log_parts(path_).size(), 3U);
  EXPECT_EQ(fs::file_size(path_), 34U + 2 * 200U);
  EXPECT_EQ(fs::file_size(log_part(path_, 1)), 34U + 2 * 200U);
  EXPECT_EQ(fs::file_size(log_part(path_, 2)), 34U + 200U);
}

}  // namespace
}  // namespace equipoise::runtime
