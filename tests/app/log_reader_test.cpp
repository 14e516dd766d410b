// Whole events of whole, torn and damaged logs, and what the others come to.
#include "app/log/log_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "app/log/run_log.hpp"
#include "app/text/errors.hpp"
#include "support/log_folder.hpp"

namespace equipoise::app {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

const std::string kSync("\xED\xA1\xDA\x01", 4);

std::string header(std::uint64_t utime, std::uint64_t channel_size, std::uint64_t data_size,
                   std::uint64_t number = 0) {
  std::string out = kSync;
  const auto put = [&out](std::uint64_t value, unsigned bytes) {
    for (unsigned i = bytes; i-- > 0;) out += static_cast<char>(value >> (8 * i));
  };
  put(number, 8);
  put(utime, 8);
  put(channel_size, 4);
  put(data_size, 4);
  return out;
}

std::string event(const std::string& channel, const std::string& data, std::uint64_t utime = 0) {
  return header(utime, channel.size(), data.size()) + channel + data;
}

/// Of a log's later part: the events are numbered through all parts.
std::string later_event(const std::string& channel, const std::string& data, std::uint64_t number) {
  return header(0, channel.size(), data.size(), number) + channel + data;
}

struct Read {
  std::vector<std::string> events;  // "channel=data@utime"
  std::size_t damaged = 0;
};

Read all(LogReader reader) {
  Read read;
  for (LogEvent e; reader.next(&e);) {
    read.events.push_back(std::string(e.channel) + "=" + std::string(e.data) + "@" + std::to_string(e.utime));
    EXPECT_LT(read.events.size(), 100000U);
  }
  read.damaged = reader.damaged_bytes();
  return read;
}
Read all(const std::string& bytes) { return all(LogReader::over(bytes)); }

TEST(LogReader, GivesChannelDataAndTime) {
  const Read read = all(event("A", "one", 0x0102030405060708) + event("", "") + event("BC", "two"));
  EXPECT_THAT(read.events, ElementsAre("A=one@72623859790382856", "=@0", "BC=two@0"));
  EXPECT_EQ(read.damaged, 0U);
}

TEST(LogReader, SkipsWhatIsNoEventAndCountsIt) {
  const Read read = all("xyz" + event("A", "1") + kSync + std::string(40, 'r') + event("B", "2") + "\xED" +
                        event("C", "3"));
  EXPECT_THAT(read.events, ElementsAre("A=1@0", "B=2@0", "C=3@0"));
  EXPECT_EQ(read.damaged, 3U + 44U + 1U);
}

TEST(LogReader, AnEventWithoutItsSyncIsNone) {
  std::string damaged = event("B", "2");
  damaged[2] = 'x';
  const Read read = all(event("A", "1") + damaged + event("C", "3"));
  EXPECT_THAT(read.events, ElementsAre("A=1@0", "C=3@0"));
  EXPECT_EQ(read.damaged, damaged.size());
}

TEST(LogReader, ATornEndIsLeftOutWhereverItIsTorn) {
  const std::string whole = event("A", "1");
  const std::string last = event("CHANNEL", "data");
  for (std::size_t size = 1; size < last.size(); ++size) {
    const Read read = all(whole + last.substr(0, size));
    EXPECT_THAT(read.events, ElementsAre("A=1@0")) << size;
    EXPECT_EQ(read.damaged, size);
  }
}

TEST(LogReader, LengthsHaveBounds) {
  const std::string longest(256, 'c');
  EXPECT_EQ(all(event(longest, "1")).events.size(), 1U);
  EXPECT_THAT(all(event(longest + "c", "1") + event("A", "1")).events, ElementsAre("A=1@0"));
  const std::string largest(1U << 24U, 'd');
  EXPECT_EQ(all(event("A", largest)).damaged, 0U);
  EXPECT_EQ(all(event("A", largest + "d") + event("A", "1")).events.size(), 1U);
  EXPECT_THAT(all(header(0, 0xFFFFFFFF, 0xFFFFFFFF) + event("A", "1")).events, ElementsAre("A=1@0"));
}

class LogFiles : public LogFolder {
 protected:
  void write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
  }
  std::string complaint() const {
    try {
      (void)all(LogReader::open(path_));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(LogFiles, ReadsAllPartsInOrder) {
  write("run.lcm", event("A", "1"));
  write("run.0002.lcm", later_event("A", "3", 2) + "torn");
  write("run.0001.lcm", later_event("A", "2", 1));
  const Read read = all(LogReader::open(path_));
  EXPECT_THAT(read.events, ElementsAre("A=1@0", "A=2@0", "A=3@0"));
  EXPECT_EQ(read.damaged, 4U);
}

TEST_F(LogFiles, ALogWhoseFirstPartsAreGoneIsRead) {
  write("run.0007.lcm", later_event("A", "8", 7));
  EXPECT_THAT(all(LogReader::open(path_)).events, ElementsAre("A=8@0"));
}

TEST_F(LogFiles, AnEventMayLieAcrossReadsAndAPartMayBeEmpty) {
  const std::string big(300000, 'd');  // a read is 262144 bytes
  write("run.lcm", event("A", big) + event("B", big) + event("C", "1"));
  write("run.0001.lcm", "");
  write("run.0002.lcm", later_event("D", "2", 3));
  const Read read = all(LogReader::open(path_));
  ASSERT_EQ(read.events.size(), 4U);
  EXPECT_EQ(read.events[1], "B=" + big + "@0");
  EXPECT_EQ(read.events[3], "D=2@0");
  EXPECT_EQ(read.damaged, 0U);
}

TEST_F(LogFiles, SyncsAreFoundAcrossReads) {
  for (std::size_t noise = 262144 - 6; noise <= 262144 + 1; ++noise) {
    write("run.lcm", std::string(noise, 'x') + event("A", "1"));
    const Read read = all(LogReader::open(path_));
    EXPECT_THAT(read.events, ElementsAre("A=1@0")) << noise;
    EXPECT_EQ(read.damaged, noise);
  }
}

TEST_F(LogFiles, NameWhatCannotBeRead) {
  EXPECT_EQ(complaint(), path_ + ": cannot be read");
  fs::create_directory(path_);
  EXPECT_EQ(complaint(), path_ + ": cannot be read: no regular file");
}

TEST_F(LogFiles, WithoutARunTheyAreNoLogOfOurs) {
  write("run.lcm", event("OTHER", "1"));
  try {
    const RunLog log(path_);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              path_ + ": is no log of a run (no EQUIPOISE_RUN of this version in it)");
  }
}

TEST(ShortName, IsTheChannelWithoutOurPrefixInLowerCase) {
  EXPECT_EQ(short_name("EQUIPOISE_STATE_EKF13"), "state_ekf13");
  EXPECT_EQ(short_name("OTHER_STATE"), "other_state");
  EXPECT_EQ(short_name("EQUIPOISE"), "equipoise");
}

TEST(CommandOf, IsWhatWasAskedForInTheTick) {
  runtime::TickRecord record{};
  record.velocity_W_m_s[0] = 0.1;
  record.velocity_W_m_s[1] = -0.2;
  record.yaw_rate_rad_s = 0.3;
  record.arm = true;
  record.command_age_s = 0.4;
  Command c = command_of(record);
  EXPECT_EQ(c.velocity_W_m_s, Vec2(0.1, -0.2));
  EXPECT_EQ(c.yaw_rate_rad_s, 0.3);
  EXPECT_TRUE(c.arm);
  EXPECT_FALSE(c.heading_reset);
  EXPECT_EQ(c.age_s, 0.4);
  record.heading_reset = true;
  EXPECT_TRUE(command_of(record).heading_reset);
}

}  // namespace
}  // namespace equipoise::app
