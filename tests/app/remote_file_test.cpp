// Files of remotes in a hand, an app's frames, what is learnt of them, and the gate before any motion.
#include "app/remote/remote_file.hpp"

#include <gmock/gmock.h>
#include <linux/input.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "app/remote/frame_device.hpp"
#include "app/remote/frame_learning.hpp"
#include "app/remote/hand_remote.hpp"
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
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\ndisarm = \"61\"\njump = \"46\"\n"), HasSubstr("jump"));
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\ndisarm = \"61\"\n[other]\nx = 1\n"), HasSubstr("other"));
  EXPECT_THAT(refusal("[remote]\ncolour = \"red\"\n" + kFrames.substr(9) + "arm = \"41\"\ndisarm = \"61\"\n"),
              HasSubstr("colour"));
  const std::string events =
      "[remote]\nkind = \"events\"\ndevice = \"/dev/input/event0\"\nspeed_m_s = 0.1\nturn_hz = 0.25\n"
      "hold_s = 2.0\n[events]\narm = \"BTN_START\"\n";
  EXPECT_EQ(refusal(events + "disarm = \"BTN_EAST KEY_ESC\"\n"), "");
  EXPECT_THAT(refusal(events + "disarm = \"BTN_OUEST\"\n"), HasSubstr("BTN_OUEST"));
  EXPECT_THAT(refusal(events + "disarm = \"ABS_X\"\n"), HasSubstr("an axis moves and turns"));
}

const std::string kButtons = "arm = \"41\"\ndisarm = \"61\"\n";

std::string with(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST(RemoteFile, ItsNumbersHaveRanges) {
  const auto given = [](const std::string& key, const std::string& value) {
    const auto at = kFrames.find(key + " = ");
    const std::string line = kFrames.substr(at, kFrames.find('\n', at) - at);
    return refusal(with(kFrames, line, key + " = " + value) + kButtons);
  };
  for (const auto& [key, value] : std::vector<std::pair<std::string, std::string>>{{"speed_m_s", "0.0"},
                                                                                   {"speed_m_s", "2.0"},
                                                                                   {"turn_hz", "0.0"},
                                                                                   {"turn_hz", "5.0"},
                                                                                   {"hold_s", "0.05"},
                                                                                   {"hold_s", "10.0"},
                                                                                   {"baud", "1200"},
                                                                                   {"baud", "115200"}})
    EXPECT_EQ(given(key, value), "") << key << value;
  for (const auto& [key, value] : std::vector<std::pair<std::string, std::string>>{{"speed_m_s", "-0.01"},
                                                                                   {"speed_m_s", "2.01"},
                                                                                   {"turn_hz", "-0.01"},
                                                                                   {"turn_hz", "5.01"},
                                                                                   {"hold_s", "0.049"},
                                                                                   {"hold_s", "10.1"},
                                                                                   {"baud", "1199"},
                                                                                   {"baud", "115201"}})
    EXPECT_THAT(given(key, value), HasSubstr(key)) << value;
}

TEST(RemoteFile, HoldsWhatWasWritten) {
  const RemoteFile file = parse_remote(kFrames + "arm = \"41\"\ndisarm = \"09af 6142\"\n", "remote.toml");
  EXPECT_EQ(file.device, "/dev/ttyS1");
  EXPECT_EQ(file.baud, 9600);
  EXPECT_EQ(file.speed_m_s, 0.1);
  EXPECT_EQ(file.turn_hz, 0.25);
  EXPECT_EQ(file.hold_s, 0.5);
  ASSERT_EQ(file.frames.size(), 3U);
  EXPECT_EQ(file.frames[0].bytes, "A");
  EXPECT_EQ(file.frames[1].bytes, "\x09\xaf");
  EXPECT_EQ(file.frames[2].bytes, "aB");
  EXPECT_EQ(to_hex(file.frames[1].bytes), "09af");
}

TEST(RemoteFile, AFrameHasUpTo32BytesOfSmallHexadecimal) {
  const auto arm = [](const std::string& hex) {
    return refusal(kFrames + "arm = \"" + hex + "\"\ndisarm = \"61\"\n");
  };
  EXPECT_EQ(arm(std::string(64, 'f')), "");
  for (const std::string& hex : {std::string(66, 'f'), std::string("4g"), std::string("g4"),
                                 std::string("4A"), std::string("414"), std::string("41g1")})
    EXPECT_THAT(arm(hex), HasSubstr("allowed: 1 to 32 bytes in hexadecimal")) << hex;
}

TEST(RemoteFile, FramesThatCannotBeToldApartAreNamed) {
  EXPECT_THAT(refusal(kFrames + "arm = \"41\"\ndisarm = \"4142\"\n"),
              HasSubstr("disarm (4142) begins with arm (41)"));
  EXPECT_EQ(refusal(kFrames + "arm = \"42 4241\"\ndisarm = \"61\"\n"), "") << "both are arm";
  EXPECT_EQ(refusal(kFrames + "arm = \"6141\"\ndisarm = \"4161\"\n"), "");
}

TEST(RemoteFile, EventsAreNamedAsTheKernelNamesThem) {
  const std::string events =
      "[remote]\nkind = \"events\"\ndevice = \"/dev/input/event0\"\nspeed_m_s = 0.1\nturn_hz = 0.25\n"
      "hold_s = 2.0\n[events]\ndisarm = \"KEY_ESC\"\narm = \"KEY_A\"\n";
  const auto bound = [&](const std::string& lines) { return parse_remote(events + lines, "remote.toml"); };
  const RemoteFile file =
      bound("forward = \"-ABS_Y KEY_W\"\nturn_right = \"ABS_RX\"\naxis_range = [-10, 20]\n");
  ASSERT_EQ(file.events.size(), 5U);
  EXPECT_EQ(file.axis_range, std::make_pair(-10, 20));
  const auto& [stick, key, turn] = std::tie(file.events[2], file.events[3], file.events[4]);
  EXPECT_TRUE(stick.axis && !key.axis && turn.axis);
  EXPECT_EQ(stick.action, HandAction::kForward);
  EXPECT_EQ(turn.action, HandAction::kTurnRight);
  EXPECT_EQ((std::array<int, 3>{stick.code, key.code, turn.code}),
            (std::array<int, 3>{ABS_Y, KEY_W, ABS_RX}));
  EXPECT_EQ((std::array<double, 3>{stick.sign, key.sign, turn.sign}), (std::array<double, 3>{-1, 1, 1}));
  EXPECT_FALSE(bound("").axis_range);
  const auto refused = [&](const std::string& lines) { return refusal(events + lines); };
  EXPECT_THAT(refused("forward = \"-KEY_W\"\n"), HasSubstr("-KEY_W")) << "a key has no other way";
  EXPECT_THAT(refused("stop = \"ABS_X\"\n"), HasSubstr("an axis moves and turns"));
  EXPECT_THAT(refused("heading_reset = \"ABS_X\"\n"), HasSubstr("an axis moves and turns"));
  EXPECT_EQ(refused("turn_right = \"ABS_X\"\n"), "");
  EXPECT_THAT(refused("axis_range = [3, 3]\n"), HasSubstr("the lower number first"));
  EXPECT_THAT(refused("axis_range = [3, 2]\n"), HasSubstr("the lower number first"));
  EXPECT_EQ(refused("axis_range = [-1000000000, 1000000000]\n"), "");
  EXPECT_THAT(refused("axis_range = [0, 1000000001]\n"), HasSubstr("axis_range"));
  EXPECT_THAT(refused("axis_range = [-1000000001, 0]\n"), HasSubstr("axis_range"));
  EXPECT_THAT(refused("jump = \"KEY_J\"\n"), HasSubstr("jump"));
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

TEST(HandGate, TakesAHalfPushAsItIs) {
  HandGate gate;
  (void)gate.limit(Hand{});
  Hand half;
  half.forward = 0.3;
  half.left = -0.4;
  half.turn = -1.0;
  EXPECT_EQ(gate.limit(half).forward, 0.3);
  EXPECT_EQ(gate.limit(half).left, -0.4);
  EXPECT_EQ(gate.limit(half).turn, -1.0);
  for (double Hand::*way : {&Hand::forward, &Hand::left, &Hand::turn}) {
    Hand only;
    only.*way = 1.0;
    HandGate shut;
    EXPECT_EQ(shut.limit(only).*way, 0.0);
    EXPECT_EQ(shut.limit(only).*way, 0.0) << "still held";
    (void)shut.limit(Hand{});
    only.disarm = true;
    EXPECT_EQ(shut.limit(only).*way, 0.0) << "after a disarm, too";
    only.disarm = false;
    EXPECT_EQ(shut.limit(only).*way, 0.0);
  }
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

/// Bytes of one press come within 30 ms of each other; the next press may be the same again.
TEST(FrameLearning, APauseEndsAPress) {
  const auto learnt = [](double pause_s) { return learn_button({{1.0, "ab"}, {1.0 + pause_s, "cd"}}); };
  EXPECT_EQ(learnt(0.029).frame, "abcd");
  EXPECT_EQ(learnt(0.031).frame, "ab");
  EXPECT_EQ(learnt(0.031).released, "cd");
  EXPECT_EQ(learn_button({{1.0, "aba"}, {1.02, "ab"}}).frame, "abaab") << "no repetition";
  EXPECT_EQ(learn_button({{1.0, "abababab"}}).frame, "ab") << "the shortest";
  EXPECT_EQ(learn_button({{1.0, "ab"}, {1.1, "x"}, {1.2, "x"}}).error, "") << "released, and again";
}

TEST(FrameLearning, AFrameHasUpTo32Bytes) {
  const auto bytes = [](int count) {
    std::string text;
    for (int i = 0; i < count; ++i) text.push_back(static_cast<char>(i + 1));
    return text;
  };
  EXPECT_EQ(learn_button({{1.0, bytes(32)}, {2.0, bytes(31)}}).error, "");
  EXPECT_EQ(learn_button({{1.0, bytes(31)}, {2.0, bytes(32)}}).error, "");
  EXPECT_THAT(learn_button({{1.0, bytes(33)}}).error, HasSubstr("32 bytes"));
  EXPECT_THAT(learn_button({{1.0, "a"}, {2.0, bytes(33)}}).error, HasSubstr("32 bytes"));
  EXPECT_THAT(learn_button(portions({"A", "B", "C"}, 0.1)).error, HasSubstr("(41, 42, ...)"));
}

TEST(FrameLearning, SaysWhatIsNoButton) {
  EXPECT_EQ(learn_button({}).error, "nothing came");
  EXPECT_THAT(learn_button(portions({"X1", "X2", "X3"}, 0.1)).error, HasSubstr("a value or a counter"));
  EXPECT_THAT(learn_button(portions({"S", "F", "S"}, 0.1)).error, HasSubstr("a value or a counter"));
  std::string long_one;
  for (int i = 0; i < 40; ++i) long_one.push_back(static_cast<char>(i));
  EXPECT_THAT(learn_button(portions({long_one}, 0.1)).error, HasSubstr("32 bytes"));
}

}  // namespace
}  // namespace equipoise::app
