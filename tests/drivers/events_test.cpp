// An event device of umockdev: a stick whose range the kernel tells, one event, then it is pulled out.
#include "events.h"

#include <errno.h>
#include <gtest/gtest.h>
#include <umockdev.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

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

}  // namespace
