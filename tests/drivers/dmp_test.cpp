#include "dmp.h"

#include <errno.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
const double kHalf = std::sqrt(0.5);

std::vector<uint8_t> firmwareBytes() {
  std::vector<uint8_t> bytes(DMP_FIRMWARE_BYTES);
  std::mt19937 random(7);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
  return bytes;
}

class DmpTest : public Testbed {
 protected:
  void SetUp() override {
    addImu();
    ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
  }
  void TearDown() override { i2c_dev_close(&bus_); }
  void start() { ASSERT_EQ(dmp_start(&dmp_, &bus_, firmwareBytes().data()), 0); }

  i2c_dev_t bus_{-1, 0};
  dmp_t dmp_{};
  dmp_packet_t packet_{};
};
}  // namespace

TEST(DmpParse, ReadsAQuaternionOfQ30) {
  dmp_packet_t packet;
  const auto bytes = dmpPacket({kHalf, 0.0, -kHalf, 0.0});
  ASSERT_EQ(dmp_parse(bytes.data(), bytes.size(), &packet), 0);
  EXPECT_NEAR(packet.attitude_wxyz[0], kHalf, 1e-9);
  EXPECT_NEAR(packet.attitude_wxyz[1], 0.0, 1e-9);
  EXPECT_NEAR(packet.attitude_wxyz[2], -kHalf, 1e-9);
  EXPECT_NEAR(packet.attitude_wxyz[3], 0.0, 1e-9);
  EXPECT_FALSE(packet.has_raw);
}

TEST(DmpParse, ReadsRawValuesOfTheLongPacket) {
  auto bytes = dmpPacket({1.0, 0.0, 0.0, 0.0});
  bytes.resize(16);
  for (const int value : {1, -2, 16384, -5, 300, -32768}) {
    bytes.push_back(static_cast<uint8_t>((value >> 8) & 0xFF));
    bytes.push_back(static_cast<uint8_t>(value & 0xFF));
  }
  bytes.resize(32, 0);
  dmp_packet_t packet;
  ASSERT_EQ(dmp_parse(bytes.data(), bytes.size(), &packet), 0);
  EXPECT_TRUE(packet.has_raw);
  EXPECT_EQ(packet.accel[1], -2);
  EXPECT_EQ(packet.accel[2], 16384);
  EXPECT_EQ(packet.gyro[0], -5);
  EXPECT_EQ(packet.gyro[2], -32768);
}

TEST(DmpParse, AcceptsTheNormBandAndNothingOutside) {
  // |q|^2 within 1 +- 2^-12
  dmp_packet_t packet;
  for (const double norm_squared : {1.0 - 0.9 / 4096, 1.0, 1.0 + 0.9 / 4096}) {
    const auto bytes = dmpPacket({std::sqrt(norm_squared), 0, 0, 0});
    ASSERT_EQ(dmp_parse(bytes.data(), bytes.size(), &packet), 0) << norm_squared;
    EXPECT_DOUBLE_EQ(packet.attitude_wxyz[0], 1.0);
  }
  packet.attitude_wxyz[0] = 42;
  for (const double norm_squared : {0.0, 0.25, 1.0 - 1.5 / 4096, 1.0 + 1.5 / 4096, 1.9}) {
    const auto bytes = dmpPacket({std::sqrt(norm_squared), 0, 0, 0});
    EXPECT_EQ(dmp_parse(bytes.data(), bytes.size(), &packet), -EBADMSG) << norm_squared;
  }
  EXPECT_EQ(packet.attitude_wxyz[0], 42) << "a refused packet must not be written";
}

/// Of the upper halves alone: a unit is 2^14, and the band is 2^28 +- 2^16. Sums of four squares by Lagrange.
TEST(DmpParse, TheNormBandHasExactEnds) {
  const auto parsed = [](std::array<int32_t, 4> upper_wxyz) {
    std::vector<uint8_t> bytes;
    int64_t norm_squared = 0;
    for (const int32_t upper : upper_wxyz) {
      norm_squared += int64_t{upper} * upper;
      for (const int shift : {8, 0}) bytes.push_back(static_cast<uint8_t>(upper >> shift));
      bytes.insert(bytes.end(), {0, 0});
    }
    bytes.resize(DMP_PACKET_BYTES, 0);
    dmp_packet_t packet;
    return std::make_pair(norm_squared - (int64_t{1} << 28), dmp_parse(bytes.data(), bytes.size(), &packet));
  };
  using Parsed = std::pair<int64_t, int>;
  EXPECT_EQ(parsed({63 * 256, 11 * 256, 2 * 256, 256}), Parsed(-65536, 0));
  EXPECT_EQ(parsed({16381, 177, 30, 23}), Parsed(-65537, -EBADMSG));
  EXPECT_EQ(parsed({64 * 256, -256, 0, 0}), Parsed(65536, 0));
  EXPECT_EQ(parsed({16385, 128, 128, 0}), Parsed(65537, -EBADMSG));
}

TEST(DmpParse, RefusesOtherLengths) {
  const std::vector<uint8_t> bytes(40, 0);
  dmp_packet_t packet;
  for (const size_t length : {size_t{0}, size_t{19}, size_t{21}, size_t{31}, size_t{33}, size_t{40}}) {
    EXPECT_EQ(dmp_parse(bytes.data(), length, &packet), -EMSGSIZE) << length;
  }
}

TEST(DmpParse, RefusesEveryMisalignmentOfAPacketStream) {
  std::vector<uint8_t> stream;
  for (int i = 0; i < 2; ++i) {
    const auto one = dmpPacket({0.5, 0.5, -0.5, 0.5});
    stream.insert(stream.end(), one.begin(), one.end());
  }
  dmp_packet_t packet;
  for (size_t shift = 1; shift < 20; ++shift) {
    EXPECT_EQ(dmp_parse(stream.data() + shift, 20, &packet), -EBADMSG) << shift;
  }
}

TEST_F(DmpTest, FirmwareFileMustHaveTheExactSize) {
  uint8_t out[DMP_FIRMWARE_BYTES];
  const auto bytes = firmwareBytes();
  const std::string image(bytes.begin(), bytes.end());
  EXPECT_EQ(dmp_read_firmware(writeFile("good", image).c_str(), out), 0);
  EXPECT_EQ(std::vector<uint8_t>(out, out + sizeof out), bytes);
  EXPECT_EQ(dmp_read_firmware(writeFile("long", image + "x").c_str(), out), -EFBIG);
  EXPECT_EQ(dmp_read_firmware(writeFile("short", image.substr(1)).c_str(), out), -ENODATA);
  EXPECT_EQ(dmp_read_firmware(writeFile("empty", "").c_str(), out), -ENODATA);
  EXPECT_EQ(dmp_read_firmware("/nonexistent/dmp.bin", out), -ENOENT);
  EXPECT_EQ(dmp_read_firmware("/tmp", out), -EISDIR);
  const NoStdin none;
  EXPECT_EQ(dmp_read_firmware(writeFile("good", image).c_str(), out), 0);
}

TEST_F(DmpTest, LoadsTheImageAndStartsIt) {
  start();
  EXPECT_EQ(imu.dmpStart(), 0x0400);
  EXPECT_EQ(imu.reg(0x6A), 0xC0);  // DMP and FIFO on
  EXPECT_EQ(imu.reg(0x38), 0x02);  // its interrupt
  const auto firmware = firmwareBytes();
  int kept = 0;
  for (uint16_t i = 0; i < DMP_FIRMWARE_BYTES; ++i) kept += imu.dmpMemory(i) == firmware[i] ? 1 : 0;
  EXPECT_GT(kept, DMP_FIRMWARE_BYTES - 100);  // all but the settings written over it
  EXPECT_EQ(imu.dmpMemory(2718), 0x20);       // 6-axis quaternion
  EXPECT_EQ(imu.dmpMemory(2742), 0x20);       // gesture word
  EXPECT_EQ(imu.dmpMemory(512 + 22), 0);      // 200 / 200 - 1
  EXPECT_EQ(imu.dmpMemory(512 + 23), 0);
  EXPECT_EQ(imu.dmpMemory(DMP_FIRMWARE_BYTES - 1), firmware.back());
}

// The published settings of the 6-axis quaternion at 200 Hz with gesture word, by the names of the vendor's
// driver; a wrong byte is another programme.
TEST_F(DmpTest, EverySettingStandsWhereTheImageHasItAndNowhereElse) {
  const std::map<uint16_t, std::vector<uint8_t>> settings = {
      {1062, {0x4C, 0xCD, 0x6C}},                                                        // FCFG_1
      {1066, {0x0C, 0xC9, 0x2C}},                                                        // FCFG_2
      {1073, {0x26, 0x46, 0x66}},                                                        // FCFG_7
      {1088, {0x36, 0x56, 0x76}},                                                        // FCFG_3
      {104, {0x02, 0xCA, 0xE3, 0x09}},                                                   // D_0_104
      {2727, {0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3}},              // CFG_15
      {2742, {0x20}},                                                                    // CFG_27
      {1208, {0xB8, 0xAA, 0xB3, 0x8D, 0xB4, 0x98, 0x0D, 0x35, 0x5D}},                    // CFG_MOTION_BIAS
      {2224, {0xF8}},                                                                    // CFG_20
      {1853, {0xD8}},                                                                    // CFG_ORIENT_INT
      {2712, {0x8B, 0x8B, 0x8B, 0x8B}},                                                  // CFG_LP_QUAT
      {2718, {0x20, 0x28, 0x30, 0x38}},                                                  // CFG_8
      {534, {0x00, 0x00}},                                                               // D_0_22
      {2753, {0xFE, 0xF2, 0xAB, 0xC4, 0xAA, 0xF1, 0xDF, 0xDF, 0xBB, 0xAF, 0xDF, 0xDF}},  // CFG_6
      {2690, {0xD8, 0xB1, 0xB9, 0xF3, 0x8B, 0xA3, 0x91, 0xB6, 0x09, 0xB4, 0xD9}},        // CFG_FIFO_ON_EVENT
  };
  start();
  std::vector<uint8_t> expected = firmwareBytes();
  for (const auto& [address, bytes] : settings)
    std::copy(bytes.begin(), bytes.end(), expected.begin() + address);
  for (uint16_t i = 0; i < DMP_FIRMWARE_BYTES; ++i) ASSERT_EQ(imu.dmpMemory(i), expected[i]) << i;
}

TEST_F(DmpTest, IsQuietWhileItIsLoaded) {
  start();
  const std::vector<std::array<uint8_t, 2>> writes = imu.writes();
  ASSERT_GE(writes.size(), 4u);
  EXPECT_EQ(writes[0], (std::array<uint8_t, 2>{0x38, 0x00}));  // no interrupt
  EXPECT_EQ(writes[1], (std::array<uint8_t, 2>{0x23, 0x00}));  // nothing into the FIFO
  EXPECT_EQ(writes[2], (std::array<uint8_t, 2>{0x6A, 0x00}));  // and nobody there to take it
}

TEST_F(DmpTest, ReportsMemoryThatReadsBackWrong) {
  imu.corruptDmpMemory(1000);
  EXPECT_EQ(dmp_start(&dmp_, &bus_, firmwareBytes().data()), -EILSEQ);
  EXPECT_EQ(imu.reg(0x6A), 0) << "not started";
}

TEST_F(DmpTest, ReportsBusErrorsWhileLoading) {
  for (const int step : {0, 2, 3, 4, 5, 300, 780}) {
    imu.failNext(EREMOTEIO, 1, step);
    EXPECT_EQ(dmp_start(&dmp_, &bus_, firmwareBytes().data()), -EREMOTEIO) << step;
  }
}

TEST_F(DmpTest, AnEmptyFifoIsNoPacketAndAHalfPacketWaits) {
  start();
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
  auto bytes = dmpPacket({1, 0, 0, 0});
  const std::vector<uint8_t> tail(bytes.begin() + 12, bytes.end());
  bytes.resize(12);
  imu.pushFifo(bytes);
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
  imu.pushFifo(tail);
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0);
  EXPECT_DOUBLE_EQ(packet_.attitude_wxyz[0], 1.0);
}

TEST_F(DmpTest, TakesTheNewestOfAShortBacklogAndEmptiesIt) {
  start();
  imu.pushFifo(dmpPacket({1, 0, 0, 0}));
  imu.pushFifo(dmpPacket({0, 1, 0, 0}));
  imu.pushFifo(dmpPacket({0, 0, 1, 0}));
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0);
  EXPECT_DOUBLE_EQ(packet_.attitude_wxyz[2], 1.0);
  EXPECT_EQ(imu.fifoSize(), 0);
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN) << "the same packet is never delivered twice";
}

TEST_F(DmpTest, DropsALongBacklogWithoutWaitingAndResumes) {
  start();
  for (int i = 0; i < 60; ++i) imu.pushFifo(dmpPacket({1, 0, 0, 0}));  // overflows 1024 bytes
  const int before = imu.transfers();
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EOVERFLOW);
  EXPECT_LE(imu.transfers() - before, 2) << "one count, one reset, no draining";
  EXPECT_EQ(imu.fifoSize(), 0);
  EXPECT_EQ(imu.reg(0x6A) & 0xC0, 0x80) << "DMP stays on, FIFO off";
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  EXPECT_EQ(imu.reg(0x6A), 0xC0);
  imu.pushFifo(dmpPacket({0, 1, 0, 0}));
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0);
  EXPECT_DOUBLE_EQ(packet_.attitude_wxyz[1], 1.0);
}

TEST_F(DmpTest, RefusesATornPacketAndResetsTheFifo) {
  start();
  imu.pushFifo(dmpPacket({1, 0, 0, 0}));
  auto torn = dmpPacket({0.8, 0.36, -0.48, 0.0});
  torn[0] = static_cast<uint8_t>(~torn[0]);
  imu.pushFifo(torn);
  packet_.attitude_wxyz[0] = 42;
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBADMSG);
  EXPECT_EQ(packet_.attitude_wxyz[0], 42) << "neither the torn packet nor the stale one before it";
  EXPECT_EQ(imu.fifoSize(), 0);
}

TEST_F(DmpTest, RefusesAShiftedStreamThatPassesTheNormTest) {
  start();
  const auto upright = dmpPacket({1, 0, 0, 0});
  for (const int shift : {4, 8, 12, 16}) {
    imu.pushFifo(upright);
    ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0);
    std::vector<uint8_t> stream = upright;
    stream.insert(stream.end(), upright.begin(), upright.end());
    stream.erase(stream.begin(), stream.begin() + shift);
    stream.resize(20);
    imu.pushFifo(stream);
    EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBADMSG) << shift;
    EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  }
}

TEST_F(DmpTest, FollowsTheFastestTurnTheGyroCanMeasure) {
  start();
  const double step_rad = 2000.0 * M_PI / 180.0 * 0.005;
  for (int i = 0; i < 200; ++i) {
    imu.pushFifo(dmpPacket({std::cos(i * step_rad / 2), 0, 0, std::sin(i * step_rad / 2)}));
    ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0) << i;
    if (i % 7 == 0) {  // some packets are late
      EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
      EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
      i += 2;
    }
  }
}

TEST_F(DmpTest, RestartsTheDmpWhenFifoResetsDoNotHelpAndKeepsTheInterruptAlive) {
  start();
  const std::vector<uint8_t> garbage(20, 0x55);
  int ticks = 0;
  while (dmp_.state != DMP_RESTARTING && ticks < 20) {
    imu.pushFifo(garbage);
    (void)dmp_poll(&dmp_, &packet_);
    ++ticks;
  }
  ASSERT_EQ(dmp_.state, DMP_RESTARTING);
  EXPECT_EQ(imu.reg(0x38), 0x01) << "raw samples drive the tick meanwhile";
  for (int i = 0; i < DMP_RESTART_TICKS; ++i) EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY) << i;
  EXPECT_EQ(dmp_.state, DMP_RUNNING);
  EXPECT_EQ(imu.reg(0x38), 0x02);
  EXPECT_EQ(imu.reg(0x6A), 0xC0);
}

TEST_F(DmpTest, ReportsBusErrorsAndRecovers) {
  start();
  imu.failNext(EREMOTEIO);
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EREMOTEIO);
  imu.pushFifo(dmpPacket({1, 0, 0, 0}));
  imu.failNext(EREMOTEIO, 1, 1);  // the count is read, the data is not: alignment is lost
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EREMOTEIO);
  imu.failNext(EREMOTEIO);  // nor does the restart get through at once
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EREMOTEIO);
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  imu.pushFifo(dmpPacket({1, 0, 0, 0}));
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), 0);
}
