// Opening a bus where there is none. A real one is opened in the virtual machine (tests/hardware).
#include <errno.h>
#include <linux/can/raw.h>
#include <sys/socket.h>

#include "can.h"
#include "fake_can.hpp"
#include "syscall_journal.hpp"
#include "testbed.hpp"

namespace {
class CanOpenTest : public Testbed {
 protected:
  void SetUp() override {
    kernel = FakeCan{};
    kernel.plays = true;
  }
  void TearDown() override {
    can_close(&port_);
    kernel.plays = false;
    EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
    EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
  }
  FakeCan& kernel = FakeCan::instance();
  can_port_t port_{};
};
}  // namespace

TEST_F(CanOpenTest, BindsToTheInterfaceAndHearsOfErrors) {
  port_.dropped = 5;
  ASSERT_EQ(can_open(&port_, "can0"), 0);
  EXPECT_EQ(kernel.interface, "can0");
  EXPECT_EQ(kernel.type, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC);
  EXPECT_EQ(kernel.protocol, CAN_RAW);
  EXPECT_EQ(kernel.address.can_family, AF_CAN);
  EXPECT_EQ(kernel.address.can_ifindex, 42);
  EXPECT_EQ(kernel.errors, can_err_mask_t{CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_ACK |
                                          CAN_ERR_TX_TIMEOUT});
  EXPECT_EQ(port_.fd, kernel.fd);
  EXPECT_EQ(port_.dropped, 0u);
  EXPECT_EQ(port_.state, CAN_BUS_ACTIVE);
}

TEST_F(CanOpenTest, IsTheInterfaceOfTheControllerAtTheAddress) {
  addNet("481cc000", "can0");
  addNet("481d0000", "can1");
  ASSERT_EQ(can_open(&port_, "481d0000"), 0);
  EXPECT_EQ(kernel.interface, "can1");
}

TEST_F(CanOpenTest, NamesHaveTheKernelsBound) {
  const std::string longest(IFNAMSIZ - 1, 'c');
  EXPECT_EQ(can_open(&port_, (longest + "c").c_str()), -ENODEV);
  EXPECT_EQ(port_.fd, -1);
  ASSERT_EQ(can_open(&port_, longest.c_str()), 0);
  EXPECT_EQ(kernel.interface, longest);
}

TEST_F(CanOpenTest, AnInterfaceThatIsDownIsTold) {
  kernel.flags = IFF_RUNNING;
  EXPECT_EQ(can_open(&port_, "can0"), -ENETDOWN);
  EXPECT_EQ(port_.fd, -1);
}

TEST_F(CanOpenTest, EveryRefusalIsToldAndLeavesNothingOpen) {
  for (int* error : {&kernel.socket_error, &kernel.index_error, &kernel.flags_error, &kernel.option_error,
                     &kernel.bind_error}) {
    *error = EPERM;
    EXPECT_EQ(can_open(&port_, "can0"), -EPERM);
    EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
    *error = 0;
  }
}
