// Events through a named pipe in the place of a gamepad, and what the loop sees of a remote in a hand.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <mutex>

#include "app/remote/event_device.hpp"
#include "app/remote/hand_remote.hpp"
#include "app/text/errors.hpp"

namespace equipoise::app {
namespace {

using ::testing::DoubleNear;
using ::testing::HasSubstr;

/// A named pipe with the kernel's records, a stick (ABS_Y) and a key in the place of a gamepad.
class EventRemote : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() / ("equipoise_events_" + std::to_string(getpid()));
    plug_in();
    file_ = parse_remote("[remote]\nkind = \"events\"\ndevice = \"" + path_ +
                             "\"\nspeed_m_s = 0.2\nturn_hz = 0.5\nhold_s = 10.0\n[events]\n"
                             "axis_range = [0, 255]\narm = \"BTN_START\"\ndisarm = \"BTN_EAST\"\n"
                             "forward = \"-ABS_Y KEY_W\"\nback = \"KEY_S\"\nturn_left = \"-ABS_RX\"\n"
                             "stop = \"BTN_SOUTH\"\nheading_reset = \"KEY_H\"\n",
                         "events.toml");
  }
  void TearDown() override { unplug(); }
  void plug_in() {
    std::filesystem::remove(path_);
    ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
    writer_ = open(path_.c_str(), O_RDWR | O_CLOEXEC);
    ASSERT_GE(writer_, 0);
  }
  void unplug() {
    if (writer_ >= 0) close(writer_);
    writer_ = -1;
    std::filesystem::remove(path_);
  }
  void put(int type, int code, int value) {
    input_event event{};
    event.type = static_cast<std::uint16_t>(type);
    event.code = static_cast<std::uint16_t>(code);
    event.value = value;
    ASSERT_EQ(write(writer_, &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }
  std::string path_;
  RemoteFile file_;
  int writer_ = -1;
};

constexpr int kCentre = 128;  // half a count beside the middle of 0 .. 255
constexpr int kUp = 0;

TEST_F(EventRemote, SticksAndKeysMove) {
  EventDevice device(file_);
  put(EV_ABS, ABS_Y, kCentre);
  put(EV_ABS, ABS_Y, kUp);
  EXPECT_THAT(device.look(0).forward, DoubleNear(1.0, 1e-12));
  put(EV_ABS, ABS_Y, 191);  // half way down: 63.5 of 127.5, beyond a dead zone of 0.1
  EXPECT_THAT(device.look(0).forward, DoubleNear(-(63.5 / 127.5 - 0.1) / 0.9, 1e-9));
  put(EV_ABS, ABS_Y, kCentre + 10);
  EXPECT_EQ(device.look(0).forward, 0.0) << "sticks do not come home exactly";
  put(EV_KEY, KEY_W, 1);
  put(EV_SYN, SYN_REPORT, 0);  // as the kernel ends every report
  EXPECT_EQ(device.look(0).forward, 1.0);
  put(EV_KEY, KEY_W, 2);
  put(EV_KEY, KEY_S, 1);
  EXPECT_EQ(device.look(0).forward, 0.0) << "forward and back";
  put(EV_KEY, KEY_S, 0);
  EXPECT_EQ(device.look(0).forward, 1.0) << "back was let go";
  put(EV_KEY, KEY_W, 0);
  EXPECT_EQ(device.look(0).forward, 0.0);
  put(EV_KEY, BTN_START, 1);
  EXPECT_TRUE(device.look(0).arm);
  put(EV_KEY, BTN_START, 2);
  EXPECT_FALSE(device.look(0).arm) << "a press is told once";
  put(EV_KEY, BTN_EAST, 1);
  EXPECT_TRUE(device.look(0).disarm);
}

TEST_F(EventRemote, AStickBeyondItsRangeIsAtItsEnd) {
  EventDevice device(file_);
  put(EV_ABS, ABS_Y, kCentre);
  put(EV_ABS, ABS_Y, -400);
  EXPECT_EQ(device.look(0).forward, 1.0);
  put(EV_KEY, KEY_S, 1);
  EXPECT_EQ(device.look(0).forward, 0.0) << "one forward and one back";
  put(EV_ABS, ABS_Y, 600);
  EXPECT_EQ(device.look(0).forward, -1.0) << "two back are no more than one";
  put(EV_KEY, KEY_S, 0);
  put(EV_KEY, KEY_W, 1);
  put(EV_ABS, ABS_Y, -400);
  EXPECT_EQ(device.look(0).forward, 1.0) << "nor are two forward";
}

TEST_F(EventRemote, EveryWayAndEveryPressIsTold) {
  file_ = parse_remote("[remote]\nkind = \"events\"\ndevice = \"" + path_ +
                           "\"\nspeed_m_s = 0.2\nturn_hz = 0.5\nhold_s = 10.0\n[events]\n"
                           "axis_range = [-100, 100]\narm = \"KEY_A\"\ndisarm = \"KEY_Q\"\n"
                           "left = \"KEY_LEFT\"\nright = \"ABS_X KEY_RIGHT\"\nturn_left = \"KEY_J\"\n"
                           "turn_right = \"ABS_RX KEY_L\"\nheading_reset = \"KEY_H\"\nstop = \"KEY_S\"\n",
                       "events.toml");
  EventDevice device(file_);
  const auto press = [&](int key) {
    put(EV_KEY, key, 1);
    const Hand hand = device.look(0);
    put(EV_KEY, key, 0);
    (void)device.look(0);
    return hand;
  };
  EXPECT_EQ(press(KEY_LEFT).left, 1.0);
  EXPECT_EQ(press(KEY_RIGHT).left, -1.0);
  EXPECT_EQ(press(KEY_J).turn, 1.0);
  EXPECT_EQ(press(KEY_L).turn, -1.0);
  const Hand reset = press(KEY_H);
  EXPECT_TRUE(reset.heading_reset && !reset.arm && !reset.disarm);
  const Hand arm = press(KEY_A);
  EXPECT_TRUE(arm.arm && !arm.disarm && !arm.heading_reset);
  const Hand disarm = press(KEY_Q);
  EXPECT_TRUE(disarm.disarm && !disarm.arm && !disarm.heading_reset);
  put(EV_ABS, ABS_X, 55);
  EXPECT_EQ(device.look(0).left, 0.0) << "where it was before is unknown, though zero is its middle";
  for (const int axis : {ABS_X, ABS_RX}) {
    put(EV_ABS, axis, 0);
    put(EV_ABS, axis, 55);
  }
  const Hand hand = device.look(0);
  EXPECT_NEAR(hand.left, -0.5, 1e-12) << "half way between the dead zone and the end";
  EXPECT_NEAR(hand.turn, -0.5, 1e-12);
  put(EV_ABS, ABS_X, 10);
  put(EV_REL, KEY_LEFT, 1);
  put(EV_KEY, ABS_RX, 0);
  EXPECT_EQ(device.look(0).left, 0.0) << "the dead zone's edge; other kinds of event are none";
  put(EV_KEY, KEY_J, 1);
  EXPECT_NEAR(device.look(0).turn, 0.5, 1e-12);
  put(EV_KEY, KEY_S, 1);
  EXPECT_EQ(device.look(0).turn, 0.0);
}

TEST_F(EventRemote, AFloodIsReadInParts) {
  EventDevice device(file_);
  for (int i = 0; i < 255; ++i) put(EV_SYN, SYN_REPORT, 0);
  put(EV_KEY, BTN_START, 1);
  put(EV_KEY, BTN_EAST, 1);
  const Hand first = device.look(0);
  EXPECT_TRUE(first.arm && !first.disarm) << "256 of them";
  const Hand second = device.look(0);
  EXPECT_TRUE(second.disarm && !second.arm);
}

TEST_F(EventRemote, AnArmBeforeTheLossIsVoidADisarmIsNot) {
  EventDevice device(file_);
  put(EV_KEY, BTN_START, 1);
  put(EV_KEY, BTN_EAST, 1);
  unplug();
  const Hand hand = device.look(0);
  EXPECT_FALSE(hand.arm || hand.present);
  EXPECT_TRUE(hand.disarm);
}

TEST_F(EventRemote, LooksForAsLongAsItIsToldOrUntilSomethingComes) {
  EventDevice device(file_);
  const auto passed = [&](int milliseconds) {
    const auto began = std::chrono::steady_clock::now();
    (void)device.look(milliseconds);
    return std::chrono::steady_clock::now() - began;
  };
  EXPECT_GE(passed(30), std::chrono::milliseconds(30));
  put(EV_KEY, KEY_W, 1);
  EXPECT_LT(passed(60'000), std::chrono::seconds(30));
}

TEST_F(EventRemote, AStickWhosePastIsUnknownWaitsUntilItIsAtRest) {
  EventDevice device(file_);
  put(EV_ABS, ABS_Y, kCentre);
  put(EV_ABS, ABS_Y, kUp);
  put(EV_KEY, KEY_W, 1);
  EXPECT_EQ(device.look(0).forward, 1.0);
  put(EV_SYN, SYN_DROPPED, 0);  // the kernel has thrown events away: releases may be among them
  EXPECT_EQ(device.look(0).forward, 0.0);
  put(EV_ABS, ABS_Y, kUp + 20);
  EXPECT_EQ(device.look(0).forward, 0.0);
  put(EV_ABS, ABS_Y, kCentre);
  put(EV_ABS, ABS_Y, kUp);
  EXPECT_THAT(device.look(0).forward, DoubleNear(1.0, 1e-12));
  put(EV_KEY, BTN_SOUTH, 1);
  put(EV_ABS, ABS_Y, kUp + 20);
  EXPECT_EQ(device.look(0).forward, 0.0) << "stop lets go, too";
}

TEST_F(EventRemote, UnpluggedItIsVoidAndItComesBack) {
  EventDevice device(file_);
  put(EV_ABS, ABS_Y, kCentre);
  put(EV_ABS, ABS_Y, kUp);
  put(EV_KEY, KEY_W, 1);
  EXPECT_TRUE(device.look(0).heard);
  unplug();
  const Hand gone = device.look(0);
  EXPECT_FALSE(gone.present || gone.heard);
  EXPECT_EQ(gone.forward, 0.0);
  const auto began = std::chrono::steady_clock::now();
  EXPECT_FALSE(device.look(30).present);
  EXPECT_GE(std::chrono::steady_clock::now() - began, std::chrono::milliseconds(30))
      << "it waits between tries";
  plug_in();
  const Hand back = device.look(0);
  EXPECT_TRUE(back.present);
  EXPECT_EQ(back.forward, 0.0) << "the key may have been let go meanwhile";
  put(EV_ABS, ABS_Y, kUp);
  EXPECT_EQ(device.look(0).forward, 0.0) << "held since before it came back";
}

TEST_F(EventRemote, SilenceIsLettingGo) {
  file_.hold_s = 0.05;
  EventDevice device(file_);
  put(EV_KEY, KEY_W, 1);
  Hand hand = device.look(0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (hand.heard && std::chrono::steady_clock::now() < end) hand = device.look(5);
  EXPECT_FALSE(hand.heard);
  EXPECT_EQ(hand.forward, 0.0);
  for (int tries = 0; tries < 100 && !hand.heard; ++tries) {  // a busy machine may be late for one
    put(EV_KEY, KEY_W, 2);
    hand = device.look(0);
  }
  EXPECT_EQ(hand.forward, 1.0) << "a key that is held speaks again";
}

TEST_F(EventRemote, OpenedItCountsAsHeardUntilItIsSilentForTooLong) {
  EXPECT_TRUE(EventDevice(file_).look(0).heard);
}

TEST_F(EventRemote, WhatCannotBeUsedIsClosedAgain) {
  const auto descriptors = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  const auto before = descriptors();
  file_.axis_range.reset();
  EXPECT_THROW(EventDevice{file_}, InputError);
  EXPECT_EQ(descriptors(), before);
  file_.axis_range = {5, 5};
  try {
    EventDevice device(file_);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("has not the axes"));
  }
  EXPECT_EQ(descriptors(), before);
}

TEST_F(EventRemote, WithoutARangeItSaysWhatToWrite) {
  file_.axis_range.reset();
  RemoteFile keys = file_;
  keys.events = {{HandAction::kForward, false, KEY_W, 1.0}};
  EXPECT_TRUE(EventDevice(keys).look(1).present) << "keys need none";
  try {
    EventDevice device(file_);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("add axis_range = [LOW, HIGH]"));
  }
}

/// What the loop sees.
class RemoteRun {
 public:
  explicit RemoteRun(const RemoteFile& file)
      : remote_(open_hand(file), {file.speed_m_s, file.turn_hz, kTimeout_s, {}}) {}

  /// Until the command is as wanted, or five seconds.
  template <class Wanted>
  bool wait(Wanted&& wanted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    for (;;) {
      const Command command = remote_.latest();
      remote_.tell(command.arm ? ArmState::kArmed : ArmState::kDisarmed);
      if (wanted(command)) return true;
      if (std::chrono::steady_clock::now() > end) return false;
      usleep(2000);
    }
  }
  static constexpr double kTimeout_s = 1.0;

 private:
  HandRemote remote_;
};

TEST_F(EventRemote, DrivesAndItsLossStopsTheMotionButNotTheMotors) {
  RemoteRun run(file_);
  put(EV_KEY, BTN_START, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return c.arm; }));
  put(EV_KEY, KEY_W, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return c.velocity_W_m_s.x() == 0.2; }));
  unplug();
  EXPECT_TRUE(run.wait([](const Command& c) {
    return c.arm && c.velocity_W_m_s.x() == 0.0 && c.age_s > RemoteRun::kTimeout_s;
  }));
  plug_in();
  EXPECT_TRUE(run.wait([](const Command& c) { return c.age_s < RemoteRun::kTimeout_s; }));
  put(EV_KEY, BTN_EAST, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return !c.arm; }));
}

TEST_F(EventRemote, FullDeflectionIsWhatTheFileSays) {
  file_ = parse_remote("[remote]\nkind = \"events\"\ndevice = \"" + path_ +
                           "\"\nspeed_m_s = 0.2\nturn_hz = 0.5\nhold_s = 10.0\n[events]\n"
                           "arm = \"KEY_A\"\ndisarm = \"KEY_Q\"\nleft = \"KEY_LEFT\"\n"
                           "turn_right = \"KEY_L\"\nheading_reset = \"KEY_H\"\n",
                       "events.toml");
  RemoteRun run(file_);
  put(EV_KEY, KEY_A, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return c.arm; }));
  put(EV_KEY, KEY_LEFT, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return c.velocity_W_m_s == Vec2(0.0, 0.2); }));
  put(EV_KEY, KEY_L, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return std::abs(c.yaw_rate_rad_s + kPi) < 1e-12; }))
      << "half a turn per second, clockwise";
  put(EV_KEY, KEY_H, 1);
  EXPECT_TRUE(run.wait([](const Command& c) { return c.heading_reset; }));
  EXPECT_TRUE(run.wait([](const Command& c) { return c.arm && !c.heading_reset; }));
}

TEST_F(EventRemote, WhatHappensIsSaidOnce) {
  std::mutex lock;
  std::vector<std::string> said;
  const auto journal = [&](const std::string& what) {
    const std::lock_guard<std::mutex> guard(lock);
    said.push_back(what);
  };
  HandRemote remote(open_hand(file_), {0.2, 0.5, 0.5, journal});
  const auto comes = [&](const std::vector<std::string>& all) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    while (std::chrono::steady_clock::now() < end) {
      {
        const std::lock_guard<std::mutex> guard(lock);
        if (said == all) return true;
      }
      usleep(2000);
    }
    return false;
  };
  put(EV_KEY, BTN_START, 1);
  EXPECT_TRUE(comes({"the remote asks for the motors"}));
  unplug();
  EXPECT_TRUE(comes({"the remote asks for the motors", "the remote is gone: nothing moves"}));
  usleep(100000);
  plug_in();
  const std::vector<std::string> all{"the remote asks for the motors", "the remote is gone: nothing moves",
                                     "the remote is back"};
  EXPECT_TRUE(comes(all));
  usleep(100000);
  EXPECT_TRUE(comes(all));
  said.clear();
  put(EV_KEY, BTN_EAST, 1);
  put(EV_KEY, KEY_H, 1);
  EXPECT_TRUE(comes({"the remote disarms", "the remote resets the heading"}));
  put(EV_KEY, BTN_EAST, 1);
  usleep(100000);
  EXPECT_TRUE(comes({"the remote disarms", "the remote resets the heading"})) << "is off already";
}

TEST_F(EventRemote, AnArmThatWasNotObeyedInTimeIsForgotten) {
  HandRemote remote(open_hand(file_), {0.2, 0.5, 3.0, {}});
  const auto began = std::chrono::steady_clock::now();
  put(EV_KEY, BTN_START, 1);
  const auto end = began + std::chrono::seconds(5);
  bool asked = false;
  bool forgotten = false;
  while (!forgotten && std::chrono::steady_clock::now() < end) {
    const bool arm = remote.latest().arm;
    remote.tell(ArmState::kDisarmed);  // safety has a reason against it
    forgotten = asked && !arm;
    asked |= arm;
  }
  EXPECT_TRUE(asked);
  EXPECT_TRUE(forgotten);
  EXPECT_GE(std::chrono::steady_clock::now() - began, std::chrono::milliseconds(2900))
      << "not before its time";
}

}  // namespace
}  // namespace equipoise::app
