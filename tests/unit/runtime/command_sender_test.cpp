// A sender believes only a robot that has answered it, and follows only what is new.
#include "equipoise/runtime/command_sender.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "command_fixture.hpp"

namespace equipoise::runtime {
namespace {

using Verdict = CommandGate::Verdict;

class Sender : public ::testing::Test {
 protected:
  command_session_t says(std::int64_t now_ms, std::int64_t to = 0) const {
    return robot_.announcement(now_ms, command_session_t::OFF, to);
  }
  /// The robot's announcement, the question to it and its answer.
  command_session_t meet(std::int64_t now_ms) {
    sender_.hear(says(now_ms));
    const auto question = sender_.ask();
    EXPECT_TRUE(question);
    EXPECT_EQ(robot_.accept(*question, now_ms), Verdict::kTaken);
    const command_session_t answer = says(now_ms, question->sender);
    EXPECT_TRUE(sender_.hear(answer));
    return answer;
  }

  const CommandKeys keys_ = keys_of(1);
  CommandGate robot_{keys_, 500};
  CommandSender sender_{keys_, "", "anna"};
};

TEST_F(Sender, ArmsOnceAndKnowsThatItDid) {
  meet(1000);
  auto& link = sender_.links().front();
  const signed_command_t first = sender_.sign(&link, link.turn, signed_command_t::ARM);
  const signed_command_t again = sender_.sign(&link, link.turn, signed_command_t::ARM);
  EXPECT_FALSE(sender_.began_turn(link, first.sequence));
  EXPECT_EQ(robot_.accept(first, 1010), Verdict::kObeyed);
  EXPECT_EQ(robot_.accept(again, 1010), Verdict::kTaken);
  sender_.hear(says(1010, first.sender));
  EXPECT_TRUE(sender_.began_turn(link, first.sequence));
  EXPECT_FALSE(sender_.began_turn(link, again.sequence));
  EXPECT_EQ(link.confirmed, again.sequence);
  EXPECT_EQ(link.turn_holder, "anna");
}

TEST_F(Sender, BelievesNoRecordingOfAnAnnouncement) {
  EXPECT_FALSE(sender_.hear(says(1000)));
  EXPECT_TRUE(sender_.links().empty());  // true words, but perhaps long ago
  const command_session_t answer = meet(1100);
  EXPECT_TRUE(sender_.hear(says(1200)));
  EXPECT_FALSE(sender_.hear(answer));
  EXPECT_EQ(sender_.links().front().heard_ms, 1200);
}

TEST_F(Sender, BelievesNoAnswerToSomebodyElse) {
  sender_.hear(says(1000));
  const auto question = sender_.ask();
  robot_.accept(*question, 1000);
  EXPECT_FALSE(sender_.hear(says(1000, question->sender + 1)));
  EXPECT_TRUE(sender_.links().empty());
}

TEST_F(Sender, AsksOncePerAnnouncement) {
  EXPECT_FALSE(sender_.ask());
  sender_.hear(says(1000));
  EXPECT_TRUE(sender_.ask());
  EXPECT_FALSE(sender_.ask());
  sender_.hear(says(1000));
  EXPECT_FALSE(sender_.ask());
  sender_.hear(says(1100));
  EXPECT_TRUE(sender_.ask());
}

TEST_F(Sender, FindsItsRobotAmongRecordingsOfAHundredEarlierStarts) {
  for (int i = 0; i < 100; ++i) {
    const CommandGate earlier(keys_, 500);
    sender_.hear(earlier.announcement(5000, 0));
    while (const auto question = sender_.ask()) EXPECT_EQ(robot_.accept(*question, 900), Verdict::kRefused);
  }
  meet(1000);
  EXPECT_EQ(sender_.links().size(), 1U);
}

TEST_F(Sender, OfTooManyStartsItForgetsThoseHeardFirst) {
  std::vector<std::int64_t> heard;
  for (int i = 0; i < 70; ++i) {
    const CommandGate start(keys_, 500);
    heard.push_back(start.announcement(1000, 0).session);
    sender_.hear(start.announcement(1000, 0));
  }
  std::vector<std::int64_t> asked;
  while (const auto question = sender_.ask()) asked.push_back(question->session);
  heard.erase(heard.begin(), heard.begin() + 6);
  EXPECT_THAT(asked, ::testing::UnorderedElementsAreArray(heard)) << "the last 64";
}

TEST_F(Sender, SeesTwoRobotsWithOneNameAndKey) {
  CommandGate twin(keys_, 500);
  meet(1000);
  sender_.hear(twin.announcement(50, 0));
  const auto question = sender_.ask();
  ASSERT_TRUE(question);
  EXPECT_EQ(robot_.accept(*question, 1000), Verdict::kRefused);
  EXPECT_EQ(twin.accept(*question, 50), Verdict::kTaken);
  sender_.hear(twin.announcement(50, 0, question->sender));
  EXPECT_EQ(sender_.links().size(), 2U);
}

TEST_F(Sender, HearsOnlyItsRobot) {
  const CommandGate other(keys_, 500, "mip");
  sender_.hear(other.announcement(1000, 0));
  EXPECT_FALSE(sender_.ask());
  EXPECT_FALSE(sender_.deaf());
  CommandSender stranger(keys_of(2), "", "anna");
  stranger.hear(says(1000));
  EXPECT_FALSE(stranger.ask());
  EXPECT_TRUE(stranger.deaf());
}

TEST_F(Sender, TellsWhoWasFaster) {
  meet(1000);
  CommandSender berta(keys_, "", "berta");
  berta.hear(says(1000));
  const auto question = berta.ask();
  robot_.accept(*question, 1000);
  berta.hear(says(1000, question->sender));
  auto& link = sender_.links().front();
  const signed_command_t ours = sender_.sign(&link, link.turn, signed_command_t::ARM);
  auto& hers = berta.links().front();
  EXPECT_EQ(robot_.accept(berta.sign(&hers, hers.turn, signed_command_t::DISARM), 1000), Verdict::kObeyed);
  EXPECT_EQ(robot_.accept(ours, 1000), Verdict::kTaken);
  EXPECT_FALSE(robot_.wish().arm);
  sender_.hear(says(1010, ours.sender));
  EXPECT_EQ(link.turn, 1);
  EXPECT_FALSE(sender_.began_turn(link, ours.sequence));
  EXPECT_EQ(link.turn_holder, "berta");
}

TEST_F(Sender, SignsWhatItIsToldInSequence) {
  meet(1000);
  auto& link = sender_.links().front();
  const std::int64_t before = link.signed_up_to;
  const signed_command_t m = sender_.sign(&link, 5, signed_command_t::DRIVE, {{0.1, -0.2}, 0.3});
  EXPECT_EQ(m.sequence, before + 1);
  EXPECT_EQ(link.signed_up_to, before + 1);
  EXPECT_EQ(m.session, link.session);
  EXPECT_EQ(m.heard_ms, 1000);
  EXPECT_EQ(m.turn, 5);
  EXPECT_EQ(m.velocity_W_m_s[0], 0.1);
  EXPECT_EQ(m.velocity_W_m_s[1], -0.2);
  EXPECT_EQ(m.yaw_rate_rad_s, 0.3);
  EXPECT_EQ(name_in(m.holder), "anna");
  EXPECT_NE(m.sender, 0);
  EXPECT_TRUE(authentic(keys_, "mbbr", m));
}

TEST_F(Sender, FollowsNewsAndNoRecordingOfATurn) {
  meet(1000);
  auto& link = sender_.links().front();
  command_session_t before = says(1100);
  EXPECT_TRUE(sender_.hear(says(1000))) << "the same instant is no recording";
  const signed_command_t arm = sender_.sign(&link, link.turn, signed_command_t::ARM);
  ASSERT_EQ(robot_.accept(arm, 1010), Verdict::kObeyed);
  ASSERT_TRUE(sender_.hear(robot_.announcement(1010, command_session_t::ARMED, arm.sender)));
  EXPECT_EQ(link.turn, 1);
  EXPECT_EQ(link.turn_sequence, arm.sequence);
  EXPECT_EQ(link.state, +command_session_t::ARMED);
  EXPECT_EQ(link.heard_ms, 1010);
  EXPECT_FALSE(sender_.hear(before)) << "of an earlier turn, although its clock is later";
  EXPECT_EQ(link.turn, 1);
}

TEST_F(Sender, AnAnswerConfirmsWhatWasSignedAndNoMore) {
  meet(1000);
  auto& link = sender_.links().front();
  const std::int64_t confirmed = link.confirmed;
  const signed_command_t m = sender_.sign(&link, 0, signed_command_t::DRIVE);
  robot_.accept(m, 1010);
  sender_.hear(says(1010));
  EXPECT_EQ(link.confirmed, confirmed) << "said to nobody";
  sender_.hear(says(1011, m.sender));
  EXPECT_EQ(link.confirmed, m.sequence);
  link.signed_up_to = m.sequence - 1;
  link.confirmed = confirmed;
  sender_.hear(says(1012, m.sender));
  EXPECT_EQ(link.confirmed, confirmed) << "of a message that it has not signed";
}

TEST_F(Sender, AClockBelowZeroIsNone) {
  EXPECT_FALSE(sender_.hear(says(-1)));
  EXPECT_FALSE(sender_.ask());
  sender_.hear(says(0));
  EXPECT_TRUE(sender_.ask());
}

TEST_F(Sender, IsDeafOnlyWhenItUnderstandsNobody) {
  CommandSender stranger(keys_of(2), "", "anna");
  EXPECT_FALSE(stranger.deaf());
  stranger.hear(says(1000));
  EXPECT_TRUE(stranger.deaf());
  const CommandGate own(keys_of(2), 500);
  stranger.hear(own.announcement(1000, 0));
  EXPECT_FALSE(stranger.deaf());
}

TEST_F(Sender, AQuestionKeepsTheClockThatItAnswers) {
  sender_.hear(says(1000));
  sender_.hear(says(900));  // older: no news
  const auto question = sender_.ask();
  ASSERT_TRUE(question);
  EXPECT_EQ(question->heard_ms, 1000);
  EXPECT_EQ(question->action, +signed_command_t::ASK);
  EXPECT_EQ(question->turn, 0);
  sender_.hear(says(1001));
  EXPECT_EQ(sender_.ask()->heard_ms, 1001);
}

TEST(SenderKeys, OfARobotSpeakForItsOwnerUnlessToldOtherwise) {
  const CommandKeys keys = keys_of(1);
  CommandGate robot(keys, 500);
  CommandSender sender(keys, "", "");
  sender.hear(robot.announcement(0, 0));
  EXPECT_EQ(name_in(sender.ask()->holder), "owner");
}

TEST(SenderKeys, AHolderIsWhoTheKeySays) {
  EXPECT_NO_THROW(CommandSender(keys_of(1).of_holder("anna"), "", ""));
  EXPECT_NO_THROW(CommandSender(keys_of(1).of_holder("anna"), "", "anna"));
  EXPECT_THROW(CommandSender(keys_of(1).of_holder("anna"), "", "berta"), std::runtime_error);
}

}  // namespace
}  // namespace equipoise::runtime
