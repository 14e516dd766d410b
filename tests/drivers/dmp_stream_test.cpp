// What the DMP's packet stream may do: jump, pile up, be refused again and again.
#include <errno.h>

#include <cmath>

#include "dmp.h"
#include "testbed.hpp"

namespace {
class DmpStreamTest : public Testbed {
 protected:
  void SetUp() override {
    addImu();
    ASSERT_EQ(i2c_dev_open(&bus_, "/dev/i2c-2", 0x68), 0);
    imu.setRegister(0x1D, 0x82);
    ASSERT_EQ(dmp_start(&dmp_, &bus_, firmware_.data()), 0);
  }
  void TearDown() override { i2c_dev_close(&bus_); }
  int pollTurned(double angle_deg) {
    imu.pushFifo(turned(angle_deg));
    return dmp_poll(&dmp_, &packet_);
  }
  static std::vector<uint8_t> turned(double angle_deg) {
    const double half = 0.5 * angle_deg * M_PI / 180.0;
    return dmpPacket({std::cos(half), 0, std::sin(half), 0});
  }
  int pollGarbage() {
    imu.pushFifo(std::vector<uint8_t>(20, 0x55));
    return dmp_poll(&dmp_, &packet_);
  }

  const std::vector<uint8_t> firmware_ = std::vector<uint8_t>(DMP_FIRMWARE_BYTES, 0x5A);
  i2c_dev_t bus_{-1, 0};
  dmp_t dmp_{};
  dmp_packet_t packet_{};
};
}  // namespace

TEST_F(DmpStreamTest, TheFifoIsLargeAndTheFilterKept) {
  EXPECT_EQ(imu.reg(0x1D), 0x42);  // MPU-6500's map: FIFO_SIZE 01 = 1024 bytes, A_DLPF_CFG as it was
}

TEST_F(DmpStreamTest, ItsStateIsNewWithEveryStart) {
  ASSERT_EQ(pollTurned(0), 0);
  ASSERT_EQ(dmp_start(&dmp_, &bus_, firmware_.data()), 0);
  EXPECT_EQ(pollTurned(180), 0) << "nothing before to be continuous with";
}

TEST_F(DmpStreamTest, ATurnOfFiftyTwoDegreesIsTheLimit) {
  ASSERT_EQ(pollTurned(0), 0);
  EXPECT_EQ(pollTurned(51), 0);
  EXPECT_EQ(pollTurned(51 - 53), -EBADMSG);
}

TEST_F(DmpStreamTest, TheNegativeOfAQuaternionIsTheSameAttitude) {
  ASSERT_EQ(pollTurned(0), 0);
  EXPECT_EQ(pollTurned(360), 0);
}

TEST_F(DmpStreamTest, EveryComponentCountsForContinuity) {
  for (size_t i = 0; i < 4; ++i) {
    std::array<double, 4> wxyz{};
    wxyz[i] = 1.0;
    ASSERT_EQ(dmp_start(&dmp_, &bus_, firmware_.data()), 0);
    for (int k = 0; k < 2; ++k) {
      imu.pushFifo(dmpPacket(wxyz));
      EXPECT_EQ(dmp_poll(&dmp_, &packet_), 0) << i;
    }
    std::array<double, 4> other{};
    other[(i + 1) % 4] = 1.0;
    imu.pushFifo(dmpPacket(other));
    EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EBADMSG) << i;
  }
}

TEST_F(DmpStreamTest, AfterFourTicksWithoutAPacketAnyAttitudeIsPossible) {
  ASSERT_EQ(pollTurned(0), 0);
  for (int i = 0; i < 3; ++i) ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
  EXPECT_EQ(pollTurned(90), -EBADMSG);
  ASSERT_EQ(dmp_start(&dmp_, &bus_, firmware_.data()), 0);
  ASSERT_EQ(pollTurned(0), 0);
  for (int i = 0; i < 4; ++i) ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
  EXPECT_EQ(pollTurned(90), 0);
}

TEST_F(DmpStreamTest, AfterAResetOfTheFifoTheOldAttitudeStillCounts) {
  ASSERT_EQ(pollTurned(0), 0);
  ASSERT_EQ(pollGarbage(), -EBADMSG);
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  for (int i = 0; i < 5; ++i) ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EAGAIN);
  EXPECT_EQ(pollTurned(90), -EBADMSG);
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  EXPECT_EQ(pollTurned(10), 0);
}

TEST_F(DmpStreamTest, FourPacketsAreABacklogAndFiveTooMany) {
  for (int i = 0; i < DMP_MAX_BACKLOG; ++i) imu.pushFifo(turned(i));
  ASSERT_EQ(dmp_poll(&dmp_, &packet_), 0);
  EXPECT_NEAR(packet_.attitude_wxyz[2], std::sin(0.5 * 3 * M_PI / 180.0), 1e-6) << "the newest";
  for (int i = 0; i < DMP_MAX_BACKLOG + 1; ++i) imu.pushFifo(turned(3));
  EXPECT_EQ(dmp_poll(&dmp_, &packet_), -EOVERFLOW);
}

TEST_F(DmpStreamTest, ThreeResetsOfTheFifoComeBeforeOneOfTheDmp) {
  ASSERT_EQ(pollTurned(0), 0);
  for (int i = 0; i < DMP_MAX_SOFT_RESETS; ++i) {
    ASSERT_EQ(pollGarbage(), -EBADMSG);
    EXPECT_EQ(imu.writes().back(), (std::array<uint8_t, 2>{0x6A, 0x84})) << "FIFO reset, DMP on";
    EXPECT_EQ(imu.reg(0x38), 0x02);
    ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
    EXPECT_EQ(dmp_.state, DMP_RUNNING);
  }
  ASSERT_EQ(pollGarbage(), -EBADMSG);
  EXPECT_EQ(imu.writes().back(), (std::array<uint8_t, 2>{0x6A, 0x0C})) << "FIFO and DMP reset";
  for (int i = 0; i < DMP_RESTART_TICKS; ++i) {
    EXPECT_EQ(dmp_.state, DMP_RESTARTING);
    ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
  }
  EXPECT_EQ(dmp_.state, DMP_RUNNING);
  EXPECT_EQ(pollTurned(90), 0) << "it began anew";
  ASSERT_EQ(pollGarbage(), -EBADMSG);
  EXPECT_EQ(imu.writes().back(), (std::array<uint8_t, 2>{0x6A, 0x84})) << "counted anew";
}

TEST_F(DmpStreamTest, AGoodPacketForgivesTheResetsBeforeIt) {
  for (int round = 0; round < 3; ++round) {
    ASSERT_EQ(pollTurned(0), 0);
    for (int i = 0; i < DMP_MAX_SOFT_RESETS - 1; ++i) {
      ASSERT_EQ(pollGarbage(), -EBADMSG);
      ASSERT_EQ(dmp_poll(&dmp_, &packet_), -EBUSY);
    }
    EXPECT_EQ(dmp_.state, DMP_RUNNING);
  }
}
