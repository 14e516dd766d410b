// An event device of umockdev: a stick whose range the kernel tells, one event, then it is pulled out.
#include "events.h"

#include <errno.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <umockdev.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "monotonic.h"
#include "syscall_journal.hpp"

namespace {

std::string hex(const void* data, std::size_t size) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string text;
  for (std::size_t i = 0; i < size; ++i) {
    const auto byte = static_cast<const unsigned char*>(data)[i];
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

class EventsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    testbed_ = umockdev_testbed_new();
    input_event moved{};
    moved.type = EV_ABS;
    moved.code = ABS_Y;
    moved.value = -1234;
    const std::string device =
        "P: /devices/pad/input/input5/event5\nN: input/event5=" + hex(&moved, sizeof moved) +
        "\nE: DEVNAME=/dev/input/event5\nE: SUBSYSTEM=input\n";
    input_absinfo about{};
    about.value = 77;
    about.minimum = -32768;
    about.maximum = 32767;
    const std::string known =
        "@DEV /dev/input/event5 (EVDEV)\nEVIOCGABS(1) 0 " + hex(&about, sizeof about) + "\n";
    GError* error = nullptr;
    ASSERT_TRUE(umockdev_testbed_add_from_string(testbed_, device.c_str(), &error)) << error->message;
    char path[] = "/tmp/equipoise_ioctl_XXXXXX";
    const int fd = mkstemp(path);
    ASSERT_GE(fd, 0);
    ASSERT_EQ(write(fd, known.data(), known.size()), static_cast<ssize_t>(known.size()));
    ::close(fd);
    EXPECT_TRUE(umockdev_testbed_load_ioctl(testbed_, nullptr, path, &error)) << error->message;
    unlink(path);
  }
  void TearDown() override {
    events_close(&events_);
    g_object_unref(testbed_);
  }
  UMockdevTestbed* testbed_ = nullptr;
  events_t events_{-1};
};

TEST_F(EventsTest, TellsRangesAndEventsAndThatItIsGone) {
  ASSERT_EQ(events_open(&events_, "/dev/input/event5"), 0);
  input_absinfo about{};
  ASSERT_EQ(events_axis(&events_, ABS_Y, &about), 0);
  EXPECT_EQ(about.minimum, -32768);
  EXPECT_EQ(about.maximum, 32767);
  EXPECT_EQ(about.value, 77);
  input_event event{};
  EXPECT_EQ(events_wait(&events_, 0), 1);
  ASSERT_EQ(events_next(&events_, &event), 0);
  EXPECT_EQ(event.code, ABS_Y);
  EXPECT_EQ(event.value, -1234);
  EXPECT_EQ(events_next(&events_, &event), -ENODEV);
}

TEST_F(EventsTest, NamesWhatIsNotThere) { EXPECT_EQ(events_open(&events_, "/dev/input/event6"), -ENOENT); }

/// A pipe in the place of a pad that is quiet.
class QuietEvents : public ::testing::Test {
 protected:
  void SetUp() override {
    SyscallJournal::instance().clear();
    path_ = ::testing::TempDir() + "equipoise_events_" + std::to_string(getpid());
    ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
    pad_ = ::open(path_.c_str(), O_RDWR);
    ASSERT_GE(pad_, 0);
  }
  void TearDown() override {
    ::close(pad_);
    unlink(path_.c_str());
  }
  std::string path_;
  int pad_ = -1;
};

TEST_F(QuietEvents, NothingThereIsToldWithoutBlocking) {
  events_t events{-1};
  ASSERT_EQ(events_open(&events, path_.c_str()), 0);
  input_event event{};
  EXPECT_EQ(events_next(&events, &event), -EAGAIN);
  const int64_t before_ns = monotonic_ns();
  EXPECT_EQ(events_wait(&events, 5), 0);
  EXPECT_GE(monotonic_ns() - before_ns, 4000000);
  ASSERT_EQ(write(pad_, &event, sizeof event), ssize_t{sizeof event});
  EXPECT_EQ(events_wait(&events, -1), 1);
  EXPECT_EQ(events_next(&events, &event), 0);
  input_absinfo about{};
  const int axis = events_axis(&events, ABS_Y, &about);  // qemu-arm says ENOSYS of what it does not know
  EXPECT_TRUE(axis == -ENOTTY || axis == -ENOSYS) << "a pipe has no axes: " << axis;
  events_close(&events);
}

TEST_F(QuietEvents, DescriptorZeroIsOneLikeAnyOtherAndIsClosedOnce) {
  const NoStdin none;
  events_t events{-1};
  ASSERT_EQ(events_open(&events, path_.c_str()), 0);
  EXPECT_EQ(events.fd, 0);
  events_close(&events);
  EXPECT_EQ(events.fd, -1);
  events_close(&events);
  EXPECT_EQ(SyscallJournal::instance().strayCloses(), 0);
  EXPECT_EQ(SyscallJournal::instance().openFiles(), 0);
  EXPECT_EQ(SyscallJournal::instance().inheritable(), 0);
}

}  // namespace
