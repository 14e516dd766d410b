// Two real CAN controllers (SJA1000) on one emulated bus: what a virtual interface cannot show. Needs root,
// `ip` and the machine of tools/vm-test. The emulated bus never fails by itself: kernel/can/can_errors.c
// counts errors into a controller, all that follows is the kernel's.
#include <can.h>
#include <errno.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace {
int ip(const std::string& arguments) {
  return std::system(("ip link set " + arguments + " 2>/dev/null").c_str());
}

// Until something can be read; emulation has no fixed pace, so the limit is generous.
bool readable(const can_port_t& port, int limit_ms = 5000) {
  pollfd wait{port.fd, POLLIN, 0};
  return poll(&wait, 1, limit_ms) == 1;
}

can_frame frameOf(canid_t id, uint8_t length, uint8_t first) {
  can_frame frame{};
  frame.can_id = id;
  frame.can_dlc = length;
  for (uint8_t i = 0; i < length; ++i) frame.data[i] = static_cast<uint8_t>(first + i);
  return frame;
}

class CanBus : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"can0", "can1"}) {
      ip(std::string(name) + " down");
      ASSERT_EQ(ip(std::string(name) + " type can bitrate 500000 restart-ms 100"), 0);
      ASSERT_EQ(ip(std::string(name) + " up"), 0);
    }
    ASSERT_EQ(can_open(&a_, "can0"), 0);
    ASSERT_EQ(can_open(&b_, "can1"), 0);
  }
  void TearDown() override {
    can_close(&a_);
    can_close(&b_);
  }
  // The controller's transmit errors, as they add up on a bus that nobody acknowledges.
  static void countErrors(const std::string& interface, int errors) {
    std::ofstream file("/sys/kernel/debug/can_errors/transmit");
    file << interface << ' ' << errors << std::flush;
    ASSERT_TRUE(file.good()) << "no can_errors module";
  }
  // Takes in what the kernel has to say until the state is reached; false: it never came.
  static bool becomes(can_port_t& port, can_bus_state state) {
    can_frame frame{};
    while (port.state != state && readable(port)) (void)can_receive(&port, &frame);
    return port.state == state;
  }
  void expectFrameCrosses(canid_t id) {
    const can_frame there = frameOf(id, 3, 50);
    can_frame seen{};
    ASSERT_EQ(can_send(&a_, &there), 0);
    ASSERT_TRUE(readable(b_));
    ASSERT_EQ(can_receive(&b_, &seen), 0);
    EXPECT_EQ(seen.can_id, id);
  }
  can_port_t a_{}, b_{};
};
}  // namespace

TEST(CanController, NeedsABitrateBeforeItComesUp) {
  ip("can0 down");
  ASSERT_EQ(ip("can0 type can bitrate 500000"), 0);
  can_port_t port{};
  EXPECT_EQ(can_open(&port, "can0"), -ENETDOWN);
  EXPECT_NE(ip("can0 type can bitrate 99000000"), 0) << "beyond the controller";
  ASSERT_EQ(ip("can0 up"), 0);
  EXPECT_EQ(can_open(&port, "can0"), 0);
  can_close(&port);
}

TEST_F(CanBus, FramesOfEveryLengthCrossBothWays) {
  for (uint8_t length = 0; length <= 8; ++length) {
    const can_frame there = frameOf(0x100u + length, length, 10);
    const can_frame back = frameOf((0x12345u + length) | CAN_EFF_FLAG, length, 90);
    can_frame seen{};
    ASSERT_EQ(can_send(&a_, &there), 0);
    ASSERT_TRUE(readable(b_));
    ASSERT_EQ(can_receive(&b_, &seen), 0);
    EXPECT_EQ(seen.can_id, there.can_id);
    EXPECT_EQ(seen.can_dlc, length);
    ASSERT_EQ(can_send(&b_, &back), 0);
    ASSERT_TRUE(readable(a_));
    ASSERT_EQ(can_receive(&a_, &seen), 0);
    EXPECT_EQ(seen.can_id, back.can_id);
    for (int i = 0; i < length; ++i) EXPECT_EQ(seen.data[i], back.data[i]);
  }
}

TEST_F(CanBus, AFullTransmitQueueDropsAndNeverBlocks) {
  ASSERT_EQ(std::system("ip link set can0 txqueuelen 2"), 0);
  const can_frame frame = frameOf(0x7FF, 8, 0);
  int sent = 0;
  for (int i = 0; i < 5000; ++i) {
    const int status = can_send(&a_, &frame);
    ASSERT_TRUE(status == 0 || status == -ENOBUFS || status == -EAGAIN) << status;
    sent += status == 0 ? 1 : 0;
  }
  EXPECT_EQ(a_.dropped, static_cast<uint32_t>(5000 - sent));
  EXPECT_GT(sent, 0);
}

TEST_F(CanBus, AnInterfaceThatGoesDownIsReportedAndComesBack) {
  const can_frame frame = frameOf(0x10, 1, 1);
  can_frame seen{};
  ASSERT_EQ(ip("can0 down"), 0);
  EXPECT_EQ(can_receive(&a_, &seen), -ENETDOWN) << "the socket is told once";
  EXPECT_EQ(can_send(&a_, &frame), -ENETDOWN);
  ASSERT_EQ(ip("can0 up"), 0);
  ASSERT_EQ(can_send(&a_, &frame), 0);
  ASSERT_TRUE(readable(b_));
  EXPECT_EQ(can_receive(&b_, &seen), 0);
}

TEST_F(CanBus, ErrorsMakeTheControllerPassiveAndItComesBack) {
  EXPECT_EQ(a_.state, CAN_BUS_ACTIVE);
  countErrors("can0", 100);
  EXPECT_TRUE(becomes(a_, CAN_BUS_WARNING));
  EXPECT_EQ(a_.tx_errors, 100);
  countErrors("can0", 130);
  EXPECT_TRUE(becomes(a_, CAN_BUS_PASSIVE));
  EXPECT_EQ(a_.tx_errors, 130);
  EXPECT_EQ(b_.state, CAN_BUS_ACTIVE) << "the other controller is well";
  expectFrameCrosses(0x21);  // passive still takes part
  countErrors("can0", 120);
  EXPECT_TRUE(becomes(a_, CAN_BUS_WARNING));
  countErrors("can0", 0);
  EXPECT_TRUE(becomes(a_, CAN_BUS_ACTIVE));
  EXPECT_EQ(a_.bus_offs, 0u);
}

TEST_F(CanBus, BusOffIsReportedAndTheKernelRestartsTheController) {
  countErrors("can0", 256);
  ASSERT_TRUE(becomes(a_, CAN_BUS_OFF));
  EXPECT_EQ(a_.bus_offs, 1u);
  ASSERT_TRUE(becomes(a_, CAN_BUS_ACTIVE)) << "restart-ms has passed";
  // The kernel says so before its queue is on again; what is sent in between vanishes without an error.
  const can_frame early = frameOf(0x30, 1, 0);
  for (int i = 0; i < 50 && !readable(b_, 100); ++i) ASSERT_EQ(can_send(&a_, &early), 0);
  can_frame seen{};
  while (readable(b_, 100)) ASSERT_EQ(can_receive(&b_, &seen), 0);
  EXPECT_EQ(seen.can_id, early.can_id);
  expectFrameCrosses(0x31);
  EXPECT_EQ(a_.bus_offs, 1u);
}

TEST_F(CanBus, WithoutAutomaticRestartItStaysOffUntilItIsRestarted) {
  ASSERT_EQ(ip("can0 down"), 0);
  ASSERT_EQ(ip("can0 type can restart-ms 0"), 0);
  ASSERT_EQ(ip("can0 up"), 0);
  countErrors("can0", 256);
  ASSERT_TRUE(becomes(a_, CAN_BUS_OFF));
  usleep(300000);
  const can_frame lost = frameOf(0x40, 8, 0);
  for (int i = 0; i < 5000; ++i) {  // never blocks
    const int status = can_send(&a_, &lost);
    ASSERT_TRUE(status == 0 || status == -ENOBUFS || status == -EAGAIN) << status;
  }
  can_frame seen{};
  EXPECT_EQ(can_receive(&b_, &seen), -EAGAIN) << "nothing crosses";
  EXPECT_EQ(can_receive(&a_, &seen), -EAGAIN) << "nobody restarts it";
  EXPECT_EQ(a_.state, CAN_BUS_OFF);
  ASSERT_EQ(ip("can0 type can restart"), 0);
  ASSERT_TRUE(becomes(a_, CAN_BUS_ACTIVE));
  expectFrameCrosses(0x41);
}
