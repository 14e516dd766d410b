// Remotes in a hand: files, an app's frames, events through a named pipe in the place of a gamepad.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <mutex>

#include "app/remote/event_device.hpp"
#include "app/remote/frame_device.hpp"
#include "app/remote/frame_learning.hpp"
#include "app/remote/hand_remote.hpp"
#include "app/text/errors.hpp"
#include "config/toml_reader.hpp"

namespace equipoise::app {
namespace {

using ::testing::DoubleNear;
using ::testing::HasSubstr;

const std::string kShipped = std::string(EQUIPOISE_SOURCE_DIR) + "/config/remotes/";

std::string refusal(const std::string& text) {
  try {
    (void)parse_remote(text, "remote.toml");
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

const std::string kFrames =
    "[remote]\nkind = \"frames\"\ndevice = \"/dev/ttyS1\"\nbaud = 9600\nspeed_m_s = 0.1\nturn_hz = 0.25\n"
    "hold_s = 0.5\n[frames]\n";

TEST(RemoteFile, ShippedOnesAreWhatTheySay) {
  const RemoteFile pad = load_remote(kShipped + "gamepad.toml");
  EXPECT_EQ(pad.kind, RemoteFile::Kind::kEvents);
  const auto forward = std::find_if(pad.events.begin(), pad.events.end(), [](const EventBinding& b) {
    return b.action == HandAction::kForward && b.code == ABS_Y;
  });
  ASSERT_NE(forward, pad.events.end());
  EXPECT_EQ(forward->sign, -1.0);  // the kernel counts a stick upwards as negative
  EXPECT_EQ(load_remote(kShipped + "keyboard.toml").events.size(), 14u);
  const RemoteFile app = load_remote(kShipped + "hc06.toml");
  EXPECT_EQ(app.kind, RemoteFile::Kind::kFrames);
  EXPECT_EQ(app.frames.size(), kHandActions.size());
}

TEST(RemoteFile, IsReadStrictly) {
  EXPECT_EQ(refusal(kFrames + "arm = \"41\"\ndisarm = \"61\"\n"), "");
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\n"), HasSubstr("needs arm and disarm"));
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\ndisarm = \"41\"\n"), HasSubstr("41 is disarm and arm"));
  EXPECT_THAT(refusal(kFrames + "arm = \"4142\"\ndisarm = \"41\"\n"), HasSubstr("begins with"));
  EXPECT_THAT(refusal(kFrames + "arm = \"4\"\ndisarm = \"61\"\n"), HasSubstr("hexadecimal"));
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\ndisarm = \"61\"\nfly = \"46\"\n"), HasSubstr("fly"));
  const std::string events =
      "[remote]\nkind = \"events\"\ndevice = \"/dev/input/event0\"\nspeed_m_s = 0.1\nturn_hz = 0.25\n"
      "hold_s = 2.0\n[events]\narm = \"BTN_START\"\n";
  EXPECT_EQ(refusal(events + "disarm = \"BTN_EAST KEY_ESC\"\n"), "");
  EXPECT_THAT(refusal(events + "disarm = \"BTN_OUEST\"\n"), HasSubstr("BTN_OUEST"));
  EXPECT_THAT(refusal(events + "disarm = \"ABS_X\"\n"), HasSubstr("an axis moves and turns"));
}

TEST(FrameMatcher, FindsFramesAmongRubbish) {
  const std::vector<FrameBinding> frames{
      {HandAction::kForward, "~F\n"}, {HandAction::kBack, "~B\n"}, {HandAction::kArm, "~~A\n"}};
  FrameMatcher matcher(frames);
  std::vector<HandAction> heard;
  for (const char byte : std::string("~F\n~~F\nx~x~B~B\n~~A\n~~~A\n")) {
    const auto action = matcher.push(byte);
    if (action) heard.push_back(*action);
  }
  EXPECT_THAT(heard, ::testing::ElementsAre(HandAction::kForward, HandAction::kForward, HandAction::kBack,
                                            HandAction::kArm, HandAction::kArm));
}

TEST(ButtonPad, AButtonLastsAsLongAsItsFramesCome) {
  ButtonPad pad(0.5);
  double now = 100.0;
  for (int i = 0; i < 10; ++i, now += 0.4) {
    pad.press(HandAction::kForward, now);
    EXPECT_EQ(pad.hand(now + 0.3).forward, 1.0);
  }
  EXPECT_EQ(pad.hand(now + 0.2).forward, 0.0);  // 0.6 s after the last one: let go, or out of range
  EXPECT_FALSE(pad.hand(now + 0.2).heard);
}

TEST(ButtonPad, StopLetsGoOfEverything) {
  ButtonPad pad(0.5);
  pad.press(HandAction::kForward, 1.0);
  pad.press(HandAction::kTurnLeft, 1.1);
  EXPECT_EQ(pad.hand(1.2).turn, 1.0);
  pad.press(HandAction::kStop, 1.2);
  EXPECT_EQ(pad.hand(1.2).turn, 0.0);
  EXPECT_EQ(pad.hand(1.2).forward, 0.0);
}

TEST(ButtonPad, OneFrameDoesNotArm) {
  ButtonPad pad(0.5);
  pad.press(HandAction::kArm, 10.0);
  EXPECT_FALSE(pad.hand(10.0).arm);
  pad.press(HandAction::kArm, 11.5);
  EXPECT_FALSE(pad.hand(11.5).arm) << "too long ago to be the same wish";
  pad.press(HandAction::kArm, 11.8);
  EXPECT_TRUE(pad.hand(11.8).arm);
  pad.press(HandAction::kArm, 11.9);
  EXPECT_FALSE(pad.hand(11.9).arm) << "held on, it is one press";
  pad.press(HandAction::kDisarm, 12.0);
  EXPECT_TRUE(pad.hand(12.0).disarm);
  pad.press(HandAction::kArm, 12.1);
  EXPECT_FALSE(pad.hand(12.1).arm) << "a disarm forgets the first half of an arm";
}

TEST(HandGate, NothingMovesBeforeEverythingWasLetGo) {
  Hand pushed;
  pushed.heard = true;
  pushed.forward = 1.0;
  pushed.left = -1.0;
  pushed.turn = 0.5;
  HandGate gate;
  EXPECT_EQ(gate.limit(pushed).forward, 0.0) << "held since before the start";
  (void)gate.limit(Hand{});
  const Hand moved = gate.limit(pushed);
  EXPECT_THAT(moved.forward, DoubleNear(std::sqrt(0.5), 1e-12));  // the diagonal is no faster
  EXPECT_THAT(moved.left, DoubleNear(-std::sqrt(0.5), 1e-12));
  EXPECT_EQ(moved.turn, 0.5);
  pushed.arm = true;
  EXPECT_EQ(gate.limit(pushed).turn, 0.0);
  pushed.arm = false;
  EXPECT_EQ(gate.limit(pushed).turn, 0.0) << "still the same push as when it was armed";
  (void)gate.limit(Hand{});
  EXPECT_EQ(gate.limit(pushed).turn, 0.5);
}

std::vector<Portion> portions(const std::vector<std::string>& bytes, double every_s) {
  std::vector<Portion> out;
  for (const std::string& each : bytes) out.push_back({static_cast<double>(out.size()) * every_s, each});
  return out;
}

TEST(FrameLearning, KnowsWhatAppsDo) {
  const LearntButton held = learn_button(portions({"F", "F", "FFF", "F"}, 0.1));
  EXPECT_EQ(held.frame, "F");
  EXPECT_EQ(held.released + held.error, "");
  const LearntButton once = learn_button(portions({"~up\r\n", "~off\r\n"}, 1.8));
  EXPECT_EQ(once.frame, "~up\r\n");
  EXPECT_EQ(once.released, "~off\r\n");
  EXPECT_EQ(once.error, "");
  // In pieces as the port gives them, repeated, then let go.
  const LearntButton pieces =
      learn_button({{0.0, "~"}, {0.01, "up"}, {0.2, "~u"}, {0.21, "p~up"}, {0.9, "0"}});
  EXPECT_EQ(pieces.frame, "~up");
  EXPECT_EQ(pieces.released, "0");
  EXPECT_EQ(pieces.error, "");
}

TEST(FrameLearning, SaysWhatIsNoButton) {
  EXPECT_EQ(learn_button({}).error, "nothing came");
  EXPECT_THAT(learn_button(portions({"X1", "X2", "X3"}, 0.1)).error, HasSubstr("a value or a counter"));
  EXPECT_THAT(learn_button(portions({"S", "F", "S"}, 0.1)).error, HasSubstr("a value or a counter"));
  std::string long_one;
  for (int i = 0; i < 40; ++i) long_one.push_back(static_cast<char>(i));
  EXPECT_THAT(learn_button(portions({long_one}, 0.1)).error, HasSubstr("32 bytes"));
}

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
                             "stop = \"BTN_SOUTH\"\n",
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
  EXPECT_TRUE(device.look(0).present);
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
class Flight {
 public:
  explicit Flight(const RemoteFile& file)
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

TEST_F(EventRemote, FliesAndItsLossStopsTheMotionButNotTheMotors) {
  Flight flight(file_);
  put(EV_KEY, BTN_START, 1);
  EXPECT_TRUE(flight.wait([](const Command& c) { return c.arm; }));
  put(EV_KEY, KEY_W, 1);
  EXPECT_TRUE(flight.wait([](const Command& c) { return c.velocity_W_m_s.x() == 0.2; }));
  unplug();
  EXPECT_TRUE(flight.wait(
      [](const Command& c) { return c.arm && c.velocity_W_m_s.x() == 0.0 && c.age_s > Flight::kTimeout_s; }));
  plug_in();
  EXPECT_TRUE(flight.wait([](const Command& c) { return c.age_s < Flight::kTimeout_s; }));
  put(EV_KEY, BTN_EAST, 1);
  EXPECT_TRUE(flight.wait([](const Command& c) { return !c.arm; }));
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
}

TEST_F(EventRemote, AnArmThatWasNotObeyedInTimeIsForgotten) {
  HandRemote remote(open_hand(file_), {0.2, 0.5, 0.5, {}});
  put(EV_KEY, BTN_START, 1);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
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
}

}  // namespace
}  // namespace equipoise::app
