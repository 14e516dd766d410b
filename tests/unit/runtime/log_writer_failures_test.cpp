// What a log does where disk, pipe and folder fail it: it says so, and what was whole stays whole.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "equipoise/runtime/log_parts.hpp"
#include "runtime/log_writer.hpp"
#include "support/file_size_limit.hpp"
#include "support/log_folder.hpp"

namespace equipoise::runtime {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class LogWriterFailures : public LogFolder {
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

TEST_F(LogWriterFailures, ADiskThatFillsUpInsideATickCostsTheWholeTick) {
  for (const rlim_t room : {550U, 401U, 599U}) {
    LogWriter log;
    ASSERT_TRUE(log.open(path_, {}));
    {
      const FileSizeLimit small(room);
      for (int tick = 0; tick < 5; ++tick) write_tick(&log);
    }
    EXPECT_FALSE(log.is_open());
    EXPECT_EQ(log.error(), path_ + ": log stopped: File too large") << "and nothing is torn";
    EXPECT_EQ(fs::file_size(path_), 400U);
  }
}

TEST_F(LogWriterFailures, AFileThatCannotBeSyncedIsReported) {
  LogLimits limits;
  limits.sync = true;
  LogWriter log;
  ASSERT_TRUE(log.open("/dev/null", limits)) << log.error();
  for (int i = 0; i < 10000 && log.error().empty(); ++i) {
    write_tick(&log);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_THAT(log.error(), HasSubstr("log stopped: Invalid argument"));
}

TEST_F(LogWriterFailures, WhatCannotBeSyncedAtTheEndIsReportedWhereSyncingWasAskedFor) {
  LogLimits limits;
  limits.sync = true;
  LogWriter log;
  ASSERT_TRUE(log.open("/dev/null", limits));
  log.close();
  EXPECT_THAT(log.error(), HasSubstr("log stopped: Invalid argument"));
  LogWriter unsynced;
  ASSERT_TRUE(unsynced.open("/dev/null", {}));
  unsynced.close();
  EXPECT_EQ(unsynced.error(), "");
}

TEST_F(LogWriterFailures, AnEventThatCannotBeCutBackIsSaidToBeTorn) {
  ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
  const int reader = open(path_.c_str(), O_RDONLY | O_NONBLOCK);
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {})) << log.error();
  std::thread leaves([reader] {
    for (int bytes = 0; ioctl(reader, FIONREAD, &bytes) == 0 && bytes == 0;)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    close(reader);
  });
  log.event(0, "CHANNEL1", std::vector<std::uint8_t>(4 << 20));  // more than a pipe holds
  log.end_tick();
  leaves.join();
  std::signal(SIGPIPE, before);
  EXPECT_THAT(log.error(), HasSubstr("log stopped: Broken pipe; its last event is torn"));
}

TEST_F(LogWriterFailures, AWriteThatASignalInterruptsGoesOn) {
  static std::atomic<int> signals{0};
  struct sigaction counts {};
  counts.sa_handler = [](int) { ++signals; };  // no SA_RESTART
  struct sigaction before {};
  ASSERT_EQ(sigaction(SIGUSR1, &counts, &before), 0);
  ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
  const int reader = open(path_.c_str(), O_RDONLY | O_NONBLOCK);
  LogWriter log;
  ASSERT_TRUE(log.open(path_, {})) << log.error();
  std::vector<std::uint8_t> data(1 << 20);  // more than a pipe holds: the writer waits
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(i % 251);
  std::string received;
  std::thread reads([reader, &received, writer = pthread_self()] {
    for (int bytes = 0; ioctl(reader, FIONREAD, &bytes) == 0 && bytes == 0;)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    while (signals < 20) {
      pthread_kill(writer, SIGUSR1);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    fcntl(reader, F_SETFL, 0);
    std::vector<char> some(65536);
    for (ssize_t n = 0; (n = ::read(reader, some.data(), some.size())) > 0;)
      received.append(some.data(), static_cast<std::size_t>(n));
  });
  log.event(0, "C", data);
  log.end_tick();
  EXPECT_EQ(log.error(), "");
  log.close();
  reads.join();
  close(reader);
  sigaction(SIGUSR1, &before, nullptr);
  ASSERT_EQ(received.size(), 28 + 1 + data.size());
  EXPECT_TRUE(std::equal(data.begin(), data.end(), received.begin() + 28 + 1,
                         [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }));
}

TEST_F(LogWriterFailures, WhatIsNoLogIsLeftAlone) {
  write("run.lcm", "first");
  LogWriter log;
  EXPECT_FALSE(log.open(path_, {}));
  EXPECT_THAT(log.error(), HasSubstr("run.lcm: exists and is no log; choose another name"));
  EXPECT_EQ(fs::file_size(path_), 5U) << "and nothing is gone";

  fs::remove(path_);
  fs::create_symlink("nowhere", folder_ / "run.0001.lcm");
  fs::create_directory(folder_ / "run.0002.lcm");
  LogWriter second;
  EXPECT_TRUE(second.open(path_, {})) << second.error();
  second.close();
  EXPECT_TRUE(fs::is_symlink(folder_ / "run.0001.lcm")) << "only what goes on with a log is a part of it";
  EXPECT_TRUE(fs::is_directory(folder_ / "run.0002.lcm"));
}

TEST_F(LogWriterFailures, KeptLogsGoBeforeTheRunsOwnFilesWhenSpaceIsShort) {
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

TEST_F(LogWriterFailures, WhereSpaceIsShortItsOwnFilesGoButTheLast) {
  LogWriter log;
  LogLimits limits;
  limits.min_free_bytes = std::int64_t{1} << 60;  // no disk has as much
  limits.max_bytes = 200;
  ASSERT_TRUE(log.open(path_, limits));
  write_tick(&log);
  EXPECT_THAT(existing_log_parts(path_), ElementsAre(log_part(path_, 1)));
  EXPECT_THAT(log.error(), HasSubstr("No space left"));
}

TEST_F(LogWriterFailures, WhereSpaceIsEnoughNothingGoes) {
  write("run.20200101T000000Z.lcm", "oldest");
  LogWriter log;
  LogLimits limits;
  limits.min_free_bytes = 1;
  limits.max_bytes = 200;
  ASSERT_TRUE(log.open(path_, limits));
  for (int tick = 0; tick < 3; ++tick) write_tick(&log);
  EXPECT_EQ(existing_log_parts(path_).size(), 4U);
  EXPECT_EQ(kept_logs(path_).size(), 1U);
  EXPECT_EQ(log.error(), "");
}

}  // namespace
}  // namespace equipoise::runtime
