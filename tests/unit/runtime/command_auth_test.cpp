// Only holders of the key command the robot, and no message counts twice, late or in another turn.
#include "equipoise/runtime/command_auth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <random>
#include <vector>

#include "command_fixture.hpp"

namespace equipoise::runtime {
namespace {

using Verdict = CommandGate::Verdict;
constexpr std::int64_t kTimeout_ms = 500;
constexpr auto kDrive = signed_command_t::DRIVE;
constexpr auto kArm = signed_command_t::ARM;
constexpr auto kDisarm = signed_command_t::DISARM;

class Gate : public ::testing::Test {
 protected:
  Verdict take(const Asked& asked, std::int64_t now_ms = 1000) {
    return gate_.accept(command_for(gate_, keys_, asked), now_ms);
  }
  const CommandWish& wish() const { return gate_.wish(); }

  const CommandKeys keys_ = keys_of(1);
  CommandGate gate_{keys_, kTimeout_ms};
};

TEST_F(Gate, TakesWhatTheKeyHolderSends) {
  ASSERT_EQ(take({1, kDrive}), Verdict::kObeyed);
  EXPECT_EQ(wish().velocity_W_m_s[0], 0.25);
  EXPECT_EQ(wish().yaw_rate_rad_s, -1.5);
  EXPECT_FALSE(wish().arm);
  EXPECT_EQ(take({5, kDrive}), Verdict::kObeyed);  // lost messages leave gaps
  const command_session_t said = gate_.announcement(1234, command_session_t::ARMED, 7);
  EXPECT_EQ(said.accepted, 2);
  EXPECT_EQ(said.refused, 0);
  EXPECT_EQ(said.sequence, 5);
  EXPECT_EQ(said.clock_ms, 1234);
  EXPECT_TRUE(said.state == command_session_t::ARMED);
  EXPECT_TRUE(authentic(keys_, said));
  EXPECT_EQ(gate_.announcement(1234, 0, 8).sequence, 0);  // of a sender it has not heard
}

TEST_F(Gate, AQuestionChangesNothing) {
  take({1, kDrive});
  EXPECT_EQ(take({2, signed_command_t::ASK}), Verdict::kTaken);
  EXPECT_EQ(wish().velocity_W_m_s[0], 0.25);
  EXPECT_EQ(wish().turn, 0);
}

TEST_F(Gate, TakesNoneOfAThousandForgedOrReplayedCommands) {
  CommandGate earlier(keys_, kTimeout_ms);
  std::vector<signed_command_t> heard;
  for (std::int64_t i = 1; i <= 100; ++i) {
    heard.push_back(command_for(gate_, keys_, {i, kDrive}));
    ASSERT_EQ(gate_.accept(heard.back(), 1000), Verdict::kObeyed);
  }
  std::mt19937 random(7);
  const auto pick = [&random](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int taken = 0;
  for (int i = 0; i < 1000; ++i) {
    signed_command_t m = heard[pick(heard.size())];  // 0: replayed as it was
    if (i % 9 > 1) m = command_for(gate_, keys_, {200 + i, kDrive});
    switch (i % 9) {
      case 1:
        m.sequence = 200 + i;
        break;
      case 2:
        m = command_for(gate_, keys_of(2), {200 + i, kDrive});
        break;
      case 3:
        m.mac[pick(sizeof m.mac)] ^= static_cast<std::uint8_t>(1U << pick(8));
        break;
      case 4:
        m.velocity_W_m_s[pick(2)] += 0.1;
        break;
      case 5:
        m.action = kDisarm;
        break;
      case 6:
        m = command_for(earlier, keys_, {200 + i, kDrive});
        break;
      case 7:
        set_name("berta", &m.holder);  // somebody else's name
        break;
      case 8:
        m = command_for(gate_, keys_, {200 + i, kDrive}, "mip");  // for another robot with this key
        break;
      default:
        break;
    }
    taken += gate_.accept(m, 1000) == Verdict::kRefused ? 0 : 1;
  }
  EXPECT_EQ(taken, 0);
  EXPECT_EQ(gate_.announcement(0, 0).refused, 1000);
  EXPECT_EQ(gate_.announcement(0, 0).accepted, 100);
  EXPECT_EQ(take({101, kDrive}), Verdict::kObeyed);  // the sender itself is not locked out
}

TEST_F(Gate, RefusesWhatIsSignedButMakesNoSense) {
  signed_command_t m = command_for(gate_, keys_, {1, kDrive});
  m.velocity_W_m_s[1] = std::numeric_limits<double>::quiet_NaN();
  sign(keys_, "mbbr", &m);
  EXPECT_EQ(gate_.accept(m, 1000), Verdict::kRefused);
  EXPECT_EQ(take({2, 5}), Verdict::kRefused);
  EXPECT_EQ(take({3, -1}), Verdict::kRefused);
  EXPECT_EQ(take({4, kDrive, 1000, 0, 0}), Verdict::kRefused);  // a sender without a number
}

TEST_F(Gate, TakesAnAnswerWhileTheAnnouncementIsRecent) {
  EXPECT_EQ(take({1, kDrive, 1000}, 1000 + kTimeout_ms), Verdict::kObeyed);
  EXPECT_EQ(take({2, kDrive, 1000}, 1001 + kTimeout_ms), Verdict::kRefused);
  EXPECT_EQ(take({3, kDrive, 1502}, 1501), Verdict::kRefused);  // it has not said that yet
  EXPECT_EQ(take({4, kDrive, -1}, 100), Verdict::kRefused);
}

TEST_F(Gate, ASequenceGrowsInBoundedJumpsOnly) {
  EXPECT_EQ(take({0, kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({-5, kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({std::numeric_limits<std::int64_t>::max(), kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({CommandGate::kLargestJump + 1, kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({CommandGate::kLargestJump, kDrive}), Verdict::kObeyed);
  EXPECT_EQ(take({CommandGate::kLargestJump, kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({CommandGate::kLargestJump - 1, kDrive}), Verdict::kRefused);
  EXPECT_EQ(take({2 * CommandGate::kLargestJump, kDrive}), Verdict::kObeyed);
}

TEST_F(Gate, AnEdgeIsObeyedOncePerTurn) {
  EXPECT_EQ(take({1, kArm, 1000, 0}), Verdict::kObeyed);
  EXPECT_TRUE(wish().arm);
  EXPECT_EQ(wish().arm_until_ms, 1000 + kTimeout_ms);
  EXPECT_EQ(take({2, kArm, 1000, 0}), Verdict::kTaken);  // said again: a retransmission
  EXPECT_EQ(take({3, kDrive, 1000, 1}), Verdict::kObeyed);
  EXPECT_EQ(take({4, kDisarm, 1000, 1}), Verdict::kObeyed);
  EXPECT_FALSE(wish().arm);
  EXPECT_EQ(wish().velocity_W_m_s[0], 0.0);                // no motion outlives its turn
  EXPECT_EQ(take({5, kArm, 1000, 1}), Verdict::kTaken);    // decided before the disarm
  EXPECT_EQ(take({6, kDrive, 1000, 1}), Verdict::kTaken);  // so is this
  EXPECT_FALSE(wish().arm);
  EXPECT_EQ(wish().velocity_W_m_s[0], 0.0);
  EXPECT_EQ(take({7, kArm, 1000, 2}), Verdict::kObeyed);  // anew, and deliberately
  EXPECT_EQ(take({8, signed_command_t::HEADING_RESET, 1000, 3}), Verdict::kObeyed);
  EXPECT_TRUE(wish().arm);
  EXPECT_EQ(wish().heading_resets, 1);
}

TEST_F(Gate, CountsWhatItObeysEachInItsPlace) {
  take({1, kArm, 990, 0});
  EXPECT_EQ(wish().arms, 1);
  EXPECT_EQ(wish().disarms, 0);
  EXPECT_EQ(wish().turn, 1);
  EXPECT_EQ(wish().heard_ms, 990);
  EXPECT_EQ(wish().yaw_rate_rad_s, 0.0) << "motion comes with DRIVE alone";
  take({2, kDrive, 995, 1});
  EXPECT_EQ(wish().turn, 1);
  EXPECT_EQ(wish().heard_ms, 995);
  take({3, signed_command_t::HEADING_RESET, 1000, 1});
  EXPECT_EQ(wish().heading_resets, 1);
  EXPECT_EQ(wish().arms, 1);
  EXPECT_TRUE(wish().arm);
  EXPECT_EQ(wish().velocity_W_m_s[0], 0.0);
  EXPECT_EQ(wish().yaw_rate_rad_s, 0.0);
  take({4, kDisarm, 1000, 2});
  EXPECT_EQ(wish().disarms, 1);
  EXPECT_EQ(wish().arms, 1);
  EXPECT_EQ(wish().turn, 3);
}

TEST_F(Gate, BothVelocitiesCountAndBothStopWithTheTurn) {
  signed_command_t m = command_for(gate_, keys_, {1, kDrive});
  m.velocity_W_m_s[1] = -0.5;
  sign(keys_, "mbbr", &m);
  ASSERT_EQ(gate_.accept(m, 1000), Verdict::kObeyed);
  EXPECT_EQ(wish().velocity_W_m_s[1], -0.5);
  m = command_for(gate_, keys_, {2, kDisarm});
  m.velocity_W_m_s[1] = -0.5;
  sign(keys_, "mbbr", &m);
  ASSERT_EQ(gate_.accept(m, 1000), Verdict::kObeyed);
  EXPECT_EQ(wish().velocity_W_m_s[1], 0.0);
}

TEST_F(Gate, TheFirstInstantOfItsClockCounts) { EXPECT_EQ(take({1, kDrive, 0}, 0), Verdict::kObeyed); }

TEST_F(Gate, EveryNumberOfACommandMustBeOne) {
  const double bad = std::numeric_limits<double>::infinity();
  const auto refused = [&](auto&& change) {
    signed_command_t m = command_for(gate_, keys_, {1, kDrive});
    change(m);
    sign(keys_, "mbbr", &m);
    return gate_.accept(m, 1000) == Verdict::kRefused;
  };
  EXPECT_TRUE(refused([&](auto& m) { m.velocity_W_m_s[0] = bad; }));
  EXPECT_TRUE(refused([&](auto& m) { m.velocity_W_m_s[1] = -bad; }));
  EXPECT_TRUE(refused([&](auto& m) { m.yaw_rate_rad_s = bad; }));
}

TEST_F(Gate, ItsRobotMayHaveAnotherNameThanTheKeys) {
  CommandGate named(keys_, kTimeout_ms, "second");
  EXPECT_EQ(name_in(named.announcement(0, 0).robot), "second");
  EXPECT_EQ(named.accept(command_for(named, keys_, {1, kDrive}), 1000), Verdict::kRefused);
  EXPECT_EQ(named.accept(command_for(named, keys_, {1, kDrive}, "second"), 1000), Verdict::kObeyed);
}

TEST_F(Gate, ACommandWithoutAHolderIsRefused) {
  signed_command_t m = command_for(gate_, keys_, {1, kDrive});
  set_name("", &m.holder);
  sign(keys_, "mbbr", &m);
  EXPECT_EQ(gate_.accept(m, 1000), Verdict::kRefused);
}

TEST(CommandNameFields, HoldNamesOfEveryAllowedLength) {
  std::uint8_t field[CommandKeys::kLongestName];
  set_name("sixteen-letters-", &field);
  EXPECT_EQ(name_in(field), "sixteen-letters-");
  set_name("a", &field);
  EXPECT_EQ(name_in(field), "a") << "nothing of the one before";
  set_name("seventeen-letters", &field);
  EXPECT_EQ(name_in(field), "seventeen-letter");
  field[0] = ' ';
  EXPECT_EQ(name_in(field), "");
}

/// docs/commands.md by another implementation: Python's hashlib.blake2b over what LCM's Python encodes.
TEST(Proofs, AreKeyedBlake2bOfTheNameAndTheMessage) {
  const CommandKeys keys = keys_of(1);  // a one and 31 zeros
  signed_command_t command{};
  command.session = 0x0102030405060708;
  command.heard_ms = 1000;
  command.sender = 7;
  command.sequence = 1;
  command.turn = 3;
  command.action = kDrive;
  command.velocity_W_m_s[0] = 0.25;
  command.velocity_W_m_s[1] = -0.5;
  command.yaw_rate_rad_s = -1.5;
  set_name("anna", &command.holder);
  command.mac[3] = 77;  // has no say
  sign(keys, "mbbr", &command);
  const std::uint8_t command_proof[] = {0xd0, 0x84, 0x39, 0xc9, 0x9c, 0x5f, 0x87, 0x13,
                                        0x5a, 0x68, 0x92, 0xd5, 0x00, 0x4a, 0xf6, 0xff};
  EXPECT_TRUE(std::equal(std::begin(command.mac), std::end(command.mac), std::begin(command_proof)));
  EXPECT_TRUE(authentic(keys, "mbbr", command));

  command_session_t announcement{};
  set_name("mbbr", &announcement.robot);
  announcement.session = command.session;
  announcement.clock_ms = 1000;
  announcement.turn = 3;
  announcement.turn_sender = 7;
  announcement.turn_sequence = 9;
  set_name("anna", &announcement.turn_holder);
  announcement.state = command_session_t::ARMED;
  announcement.to = 7;
  announcement.sequence = 9;
  announcement.accepted = 4;
  announcement.refused = 5;
  sign(keys, &announcement);
  const std::uint8_t proof[] = {0xe5, 0xa8, 0xa9, 0x06, 0x72, 0x04, 0x37, 0x42,
                                0x65, 0x1d, 0x81, 0xef, 0x2e, 0xe1, 0x48, 0xbd};
  EXPECT_TRUE(std::equal(std::begin(announcement.mac), std::end(announcement.mac), std::begin(proof)));
  EXPECT_TRUE(authentic(keys, announcement));
}

TEST(Proofs, OfOneBitLessAreNone) {
  const CommandKeys keys = keys_of(1);
  signed_command_t command{};
  set_name("anna", &command.holder);
  sign(keys, "mbbr", &command);
  for (std::uint8_t& byte : command.mac) {
    for (int bit = 0; bit < 8; ++bit) {
      byte ^= static_cast<std::uint8_t>(1U << bit);
      EXPECT_FALSE(authentic(keys, "mbbr", command));
      byte ^= static_cast<std::uint8_t>(1U << bit);
    }
  }
  EXPECT_TRUE(authentic(keys, "mbbr", command));
}

TEST_F(Gate, SaysWhoBeganTheTurn) {
  take({9, kArm});
  const command_session_t said = gate_.announcement(1000, 0);
  EXPECT_EQ(said.turn, 1);
  EXPECT_EQ(said.turn_sender, 7);
  EXPECT_EQ(said.turn_sequence, 9);
  EXPECT_EQ(name_in(said.turn_holder), "anna");
  EXPECT_EQ(name_in(said.robot), "mbbr");
}

TEST_F(Gate, SendersCountEachForItself) {
  EXPECT_EQ(take({500, kDrive, 1000, 0, 7}), Verdict::kObeyed);
  EXPECT_EQ(take({1, kDrive, 1000, 0, 8}), Verdict::kObeyed);
  EXPECT_EQ(take({1, kDrive, 1000, 0, 8}), Verdict::kRefused);
  EXPECT_EQ(take({501, kDrive, 1000, 0, 7}), Verdict::kObeyed);
}

TEST_F(Gate, ASendersPlaceIsFreeWhenNothingItSignedCanCount) {
  for (std::int64_t id = 1; id <= 8; ++id) EXPECT_EQ(take({1, kDrive, 1000, 0, id}), Verdict::kObeyed);
  EXPECT_EQ(take({1, kDrive, 1100, 0, 9}, 1100), Verdict::kRefused);
  EXPECT_EQ(take({2, kDrive, 1400, 0, 3}, 1400), Verdict::kObeyed);
  EXPECT_EQ(take({1, kDrive, 1501, 0, 9}, 1501), Verdict::kObeyed);  // in the first one's place
  EXPECT_EQ(take({1, kDrive, 1000, 0, 1}, 1501), Verdict::kRefused);
  EXPECT_EQ(take({2, kDrive, 1400, 0, 3}, 1501), Verdict::kRefused);
  EXPECT_EQ(take({3, kDrive, 1399, 0, 3}, 1501), Verdict::kRefused);  // answers an older one than its last
}

TEST_F(Gate, ASenderIsForgottenOnlyWhenItsLastWordIsTooOld) {
  for (std::int64_t id = 1; id <= 8; ++id) EXPECT_EQ(take({1, kDrive, 1000, 0, id}), Verdict::kObeyed);
  EXPECT_EQ(take({1, kDrive, 1500, 0, 9}, 1000 + kTimeout_ms), Verdict::kRefused) << "it may still count";
  EXPECT_EQ(take({1, kDrive, 1501, 0, 9}, 1001 + kTimeout_ms), Verdict::kObeyed);
  EXPECT_EQ(gate_.announcement(1501, 0, 9).sequence, 1);
  EXPECT_EQ(gate_.announcement(1501, 0, 1).sequence, 0) << "forgotten";
  EXPECT_EQ(gate_.announcement(1501, 0, 0).sequence, 0) << "to nobody";
}

TEST_F(Gate, EverySessionIsAnother) {
  const CommandGate other(keys_, kTimeout_ms);
  EXPECT_NE(gate_.announcement(0, 0).session, other.announcement(0, 0).session);
}

TEST_F(Gate, AnnouncementsCannotBeForged) {
  const command_session_t said = gate_.announcement(1000, command_session_t::ARMED, 7);
  const auto changed = [&](auto&& change) {
    command_session_t m = said;
    change(m);
    return authentic(keys_, m);
  };
  EXPECT_FALSE(changed([](auto& m) { m.state = command_session_t::OFF; }));
  EXPECT_FALSE(changed([](auto& m) { ++m.turn; }));
  EXPECT_FALSE(changed([](auto& m) { ++m.sequence; }));
  EXPECT_FALSE(changed([](auto& m) { m.robot[0] = 'x'; }));
  EXPECT_FALSE(changed([](auto& m) { m.mac[15] ^= 1; }));
  EXPECT_FALSE(authentic(keys_of(2), said));
}

}  // namespace
}  // namespace equipoise::runtime
