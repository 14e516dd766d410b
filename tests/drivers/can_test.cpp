// The bus itself needs a virtual machine (tests/hardware); here a socket pair plays it.
#include "can.h"

#include <errno.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include "syscall_journal.hpp"

namespace {
can_frame errorFrame(canid_t kind, uint8_t controller = 0, uint8_t tx = 0, uint8_t rx = 0) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | kind;
  frame.can_dlc = CAN_ERR_DLC;
  frame.data[1] = controller;
  frame.data[6] = tx;
  frame.data[7] = rx;
  return frame;
}

can_frame dataFrame(canid_t id, uint8_t first) {
  can_frame frame{};
  frame.can_id = id;
  frame.can_dlc = 1;
  frame.data[0] = first;
  return frame;
}

class CanTest : public ::testing::Test {
 protected:
  void SetUp() override {
    int ends[2];
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    port_.fd = ends[0];
    bus_ = ends[1];
  }
  void TearDown() override {
    can_close(&port_);
    close(bus_);
  }
  void arrive(const can_frame& frame) { ASSERT_EQ(write(bus_, &frame, sizeof frame), ssize_t{sizeof frame}); }
  can_port_t port_{};
  int bus_ = -1;
};
}  // namespace

TEST_F(CanTest, ReturnsDataFramesAndKeepsErrorFramesToItself) {
  arrive(errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, 100, 3));
  arrive(dataFrame(0x123, 7));
  can_frame frame{};
  ASSERT_EQ(can_receive(&port_, &frame), 0);
  EXPECT_EQ(frame.can_id, 0x123u);
  EXPECT_EQ(frame.data[0], 7);
  EXPECT_EQ(port_.state, CAN_BUS_WARNING);
  EXPECT_EQ(port_.tx_errors, 100);
  EXPECT_EQ(port_.rx_errors, 3);
  EXPECT_EQ(can_receive(&port_, &frame), -EAGAIN);
}

TEST_F(CanTest, AStormOfErrorFramesDoesNotHoldTheCaller) {
  for (int i = 0; i < 65; ++i) arrive(errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW));
  arrive(dataFrame(1, 1));
  can_frame frame{};
  EXPECT_EQ(can_receive(&port_, &frame), -EAGAIN);
  EXPECT_EQ(port_.rx_overruns, 64u);
  EXPECT_EQ(can_receive(&port_, &frame), 0);
}

TEST_F(CanTest, SendsAndCountsWhatTheFullQueueDrops) {
  const can_frame frame = dataFrame(0x321, 9);
  ASSERT_EQ(can_send(&port_, &frame), 0);
  can_frame seen{};
  ASSERT_EQ(read(bus_, &seen, sizeof seen), ssize_t{sizeof seen});
  EXPECT_EQ(seen.can_id, 0x321u);
  int status = 0;
  for (int i = 0; i < 100000 && status == 0; ++i) status = can_send(&port_, &frame);
  EXPECT_EQ(status, -EAGAIN);
  EXPECT_EQ(port_.dropped, 1u);
}

TEST_F(CanTest, RefusesLongFramesAndTornOnes) {
  can_frame frame = dataFrame(1, 1);
  frame.can_dlc = 9;
  EXPECT_EQ(can_send(&port_, &frame), -EINVAL);
  ASSERT_EQ(write(bus_, &frame, 5), ssize_t{5});
  EXPECT_EQ(can_receive(&port_, &frame), -EBADMSG);
  arrive(frame);
  EXPECT_EQ(can_receive(&port_, &frame), -EBADMSG);
  ASSERT_EQ(shutdown(bus_, SHUT_WR), 0);
  EXPECT_EQ(can_receive(&port_, &frame), -EBADMSG) << "nothing at all is no frame";
}

TEST_F(CanTest, AFrameMayHaveEightBytes) {
  can_frame frame = dataFrame(1, 1);
  frame.can_dlc = 8;
  ASSERT_EQ(can_send(&port_, &frame), 0);
  arrive(frame);
  ASSERT_EQ(can_receive(&port_, &frame), 0);
  EXPECT_EQ(frame.can_dlc, 8);
}

TEST_F(CanTest, ABrokenPortIsToldAndNoDrop) {
  close(bus_);
  const can_frame frame = dataFrame(1, 1);
  signal(SIGPIPE, SIG_IGN);
  EXPECT_EQ(can_send(&port_, &frame), -EPIPE);
  signal(SIGPIPE, SIG_DFL);
  EXPECT_EQ(port_.dropped, 0u);
  bus_ = open("/dev/null", O_RDWR);
}

TEST_F(CanTest, IsClosedOnce) {
  SyscallJournal& journal = SyscallJournal::instance();
  journal.clear();
  journal.opened(port_.fd);
  can_close(&port_);
  EXPECT_EQ(port_.fd, -1);
  can_close(&port_);
  EXPECT_EQ(journal.openFiles(), 0);
  EXPECT_EQ(journal.strayCloses(), 0);
}

TEST(CanState, EveryCounterOfTheControllerIsKept) {
  can_port_t port{};
  can_frame frame = errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE, 12, 130);
  can_update_state(&port, &frame);
  EXPECT_EQ(port.state, CAN_BUS_PASSIVE);
  EXPECT_EQ(port.tx_errors, 12);
  EXPECT_EQ(port.rx_errors, 130);
  EXPECT_EQ(port.rx_overruns, 0u);
  frame = errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, 131, 1);
  can_update_state(&port, &frame);
  EXPECT_EQ(port.state, CAN_BUS_PASSIVE);
  frame = errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING);
  can_update_state(&port, &frame);
  EXPECT_EQ(port.state, CAN_BUS_WARNING);
  frame = errorFrame(CAN_ERR_RESTARTED, CAN_ERR_CRTL_RX_OVERFLOW, 9, 9);
  can_update_state(&port, &frame);
  EXPECT_EQ(port.state, CAN_BUS_ACTIVE);
  EXPECT_EQ(port.rx_overruns, 0u) << "the controller's byte counts in its own frames only";
  EXPECT_EQ(port.tx_errors, 0);
}

TEST(CanState, FollowsTheControllerDownAndUpAgain) {
  can_port_t port{};
  const auto after = [&port](const can_frame& frame) {
    can_update_state(&port, &frame);
    return port.state;
  };
  EXPECT_EQ(after(errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING)), CAN_BUS_WARNING);
  EXPECT_EQ(after(errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_TX_WARNING)),
            CAN_BUS_PASSIVE);
  EXPECT_EQ(after(errorFrame(CAN_ERR_ACK)), CAN_BUS_PASSIVE) << "says nothing about the state";
  EXPECT_EQ(after(errorFrame(CAN_ERR_BUSOFF)), CAN_BUS_OFF);
  EXPECT_EQ(after(errorFrame(CAN_ERR_BUSOFF)), CAN_BUS_OFF);
  EXPECT_EQ(port.bus_offs, 1u);
  EXPECT_EQ(after(errorFrame(CAN_ERR_RESTARTED)), CAN_BUS_ACTIVE);
  EXPECT_EQ(after(errorFrame(CAN_ERR_BUSOFF)), CAN_BUS_OFF);
  EXPECT_EQ(port.bus_offs, 2u);
  EXPECT_EQ(after(errorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE)), CAN_BUS_ACTIVE);
}

TEST(CanOpen, ReportsAMissingInterface) {
  can_port_t port{};
  const int probe = socket(PF_CAN, SOCK_RAW, 1);
  const int expected = probe < 0 ? -errno : -ENODEV;  // a kernel without CAN cannot even make the socket
  if (probe >= 0) close(probe);
  EXPECT_EQ(can_open(&port, "can_none"), expected);
  EXPECT_EQ(port.fd, -1);
}
