#include "app/log/run_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <regex>
#include <sstream>

#include "app/text/errors.hpp"
#include "equipoise/runtime/wire.hpp"

namespace equipoise::app {
namespace {

using runtime::Bytes;
using runtime::TickRecord;
namespace fields = runtime::fields;

// "type name size" of each field, as the list has them.
template <class Message, class Record>
std::vector<std::string> listed(Message, Record record) {
  std::vector<std::string> out{"int64_t utime 1"};
  if (runtime::kHasTick<Message>) out.emplace_back("int64_t tick 1");
  Message::visit(record, [&](const char* name, const auto& value) {
    const auto line = [&](auto element, std::size_t count) {
      using T = decltype(element);
      const char* type = std::is_same_v<T, bool>          ? "boolean"
                         : std::is_same_v<T, double>      ? "double"
                         : std::is_same_v<T, std::string> ? "string"
                         : sizeof(T) == 8                 ? "int64_t"
                                                          : "int32_t";
      out.push_back(std::string(type) + " " + name + " " + std::to_string(count));
    };
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_arithmetic_v<Value> || std::is_same_v<Value, std::string>) {
      line(value, 1);
    } else {
      line(value[0], std::size(value));
    }
  });
  return out;
}

// The same from lcm/TYPE.lcm.
std::vector<std::string> declared(const std::string& type) {
  std::ifstream file(std::string(EQUIPOISE_SOURCE_DIR) + "/lcm/" + type + ".lcm");
  std::vector<std::string> out;
  const std::regex field(R"(^\s*(\w+)\s+(\w+)(?:\[(\d+)\])?;.*)");
  std::smatch match;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("package", 0) == 0 || !std::regex_match(line, match, field)) continue;
    out.push_back(match[1].str() + " " + match[2].str() + " " + (match[3].matched ? match[3].str() : "1"));
  }
  return out;
}

template <class Message, class Record>
void expect_same_layout(Message message, const Record& record) {
  EXPECT_EQ(listed(message, record), declared(Message::kType)) << Message::kType;
}

// A different value in every place.
struct Distinct {
  double next = 1.0;
  template <class T>
  void operator()(const char*, T& value) {
    if constexpr (std::is_same_v<T, std::string>) {
      value = "text " + std::to_string(next++);
    } else if constexpr (std::is_same_v<T, bool>) {
      value = !value;
    } else if constexpr (std::is_arithmetic_v<T>) {
      value = static_cast<T>(sizeof(T) == 8 ? -1e15 * next++ : 1e6 * next++);
    } else {
      for (auto& element : value) (*this)("", element);
    }
  }
};

// lcm-gen's class decodes what the list encodes, and encodes the same again.
template <class Generated, class Message, class Record>
void expect_generated_code_agrees(Message message, Record record) {
  Distinct distinct;
  Message::visit(record, distinct);
  Bytes bytes;
  runtime::encode(message, record, 123456789012, 77, &bytes);
  Generated generated;
  const int size = static_cast<int>(bytes.size());
  ASSERT_EQ(generated.decode(bytes.data(), 0, size), size) << Message::kType;
  Bytes again(bytes.size());
  EXPECT_EQ(generated.encode(again.data(), 0, size), size);
  EXPECT_EQ(again, bytes) << Message::kType;
  EXPECT_EQ(generated.utime, 123456789012);

  Record back{};
  std::int64_t utime = 0;
  std::int64_t tick = 0;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  ASSERT_TRUE(runtime::decode(message, text, &back, &utime, &tick));
  Bytes third;
  runtime::encode(message, back, utime, 77, &third);
  EXPECT_EQ(third, bytes);
  EXPECT_FALSE(runtime::decode(message, text.substr(0, text.size() - 1), &back, &utime, &tick));
}

std::string event(std::string_view channel, const Bytes& data) {
  std::string out("\xED\xA1\xDA\x01", 4);
  const auto put = [&out](std::uint64_t value, unsigned bytes) {
    for (unsigned i = bytes; i-- > 0;) out += static_cast<char>(value >> (8 * i));
  };
  put(0, 8);
  put(0, 8);
  put(channel.size(), 4);
  put(data.size(), 4);
  return out.append(channel).append(data.begin(), data.end());
}

// The messages of one tick, and of an estimator beside it.
std::string tick_events(std::int64_t tick, const std::string& without = "") {
  TickRecord r{};
  r.truth.theta_rad[0] = 0.25;
  r.others[0].theta_rad[0] = 0.5;
  std::string out;
  Bytes bytes;
  const auto add = [&](auto message, const char* channel, const auto& record) {
    runtime::encode(message, record, 5000 * tick, tick, &bytes);
    if (without != channel) out += event(channel, bytes);
  };
  fields::each_message(r, add);
  add(fields::State{}, "EQUIPOISE_STATE_EKF13", r.others[0]);
  add(fields::State{}, fields::kTruthChannel, r.truth);
  return out;
}

Bytes run_message() {
  runtime::RunInfo run;
  run.robot = "mbbr";
  run.config_toml = "a = 1";
  Bytes bytes;
  runtime::encode(fields::Run{}, run, 0, 0, &bytes);
  return bytes;
}

std::string run_event() { return event(fields::kRunChannel, run_message()); }

TEST(FieldList, IsWhatTheLcmTypesDeclare) {
  const TickRecord none{};
  fields::each_message(
      none, [](auto message, const char*, const auto& record) { expect_same_layout(message, record); });
  expect_same_layout(fields::Histogram{}, fields::HistogramRecord{});
  expect_same_layout(fields::Run{}, runtime::RunInfo{});
  expect_same_layout(fields::End{}, runtime::EndRecord{});
  expect_same_layout(fields::Faults{}, FaultEvidence{});
}

TEST(FieldList, HoldsEveryByteOfASampleAndOfAState) {
  std::size_t bytes = 0;
  const auto add = [&bytes](const char*, const auto& value) { bytes += sizeof value; };
  const TickRecord tick{};
  fields::Sensors::visit(tick, add);
  EXPECT_EQ(bytes, sizeof(RawSample));
  bytes = 0;
  fields::State::visit(tick.estimate, add);
  EXPECT_EQ(bytes, sizeof(runtime::StateRecord));
}

TEST(FieldList, EncodesWhatGeneratedCodeDecodes) {
  expect_generated_code_agrees<sensors_t>(fields::Sensors{}, TickRecord{});
  expect_generated_code_agrees<command_t>(fields::CommandFields{}, TickRecord{});
  expect_generated_code_agrees<state_t>(fields::State{}, runtime::StateRecord{});
  expect_generated_code_agrees<motors_t>(fields::Motors{}, TickRecord{});
  expect_generated_code_agrees<health_t>(fields::Health{}, TickRecord{});
  expect_generated_code_agrees<timing_t>(fields::Timing{}, TickRecord{});
  expect_generated_code_agrees<timing_histogram_t>(fields::Histogram{}, fields::HistogramRecord{});
  expect_generated_code_agrees<run_t>(fields::Run{}, runtime::RunInfo{});
  expect_generated_code_agrees<verdict_t>(fields::End{}, runtime::EndRecord{});
  expect_generated_code_agrees<faults_t>(fields::Faults{}, FaultEvidence{});
}

TEST(FieldList, PutsEachFieldWhereTheGeneratedCodeLooksForIt) {
  TickRecord r{};
  r.raw.imu_temperature_degC = 41.5;
  r.raw.health = 0x80000001U;
  r.degraded = 5;
  r.motor_count = 3;
  r.battery_V = 7.25;
  Bytes bytes;
  sensors_t sensors{};
  runtime::encode(fields::Sensors{}, r, 1, 2, &bytes);
  sensors.decode(bytes.data(), 0, static_cast<int>(bytes.size()));
  EXPECT_EQ(sensors.imu_temperature_degC, 41.5);
  EXPECT_EQ(static_cast<std::uint32_t>(sensors.health), 0x80000001U);
  health_t health{};
  runtime::encode(fields::Health{}, r, 1, 2, &bytes);
  health.decode(bytes.data(), 0, static_cast<int>(bytes.size()));
  EXPECT_EQ(health.degraded, 5);
  EXPECT_EQ(health.battery_V, 7.25);
  motors_t motors{};
  runtime::encode(fields::Motors{}, r, 1, 2, &bytes);
  motors.decode(bytes.data(), 0, static_cast<int>(bytes.size()));
  EXPECT_EQ(motors.motors, 3);
}

TEST(RunLog, ATickThatLacksAMessageIsCountedAndLeftOut) {
  RunLog log(run_event() + tick_events(0) + tick_events(1, "EQUIPOISE_MOTORS") + tick_events(2), "a.lcm");
  std::vector<std::int64_t> ticks;
  for (TickRecord tick; log.next(&tick);) {
    ticks.push_back(tick.tick);
    EXPECT_EQ(tick.now_ns, 5000000 * tick.tick);
    EXPECT_TRUE(tick.has_truth);
    EXPECT_EQ(tick.truth.theta_rad[0], 0.25);
    EXPECT_EQ(tick.compared, 1U);
    EXPECT_EQ(tick.others[0].theta_rad[0], 0.5);
  }
  EXPECT_THAT(ticks, testing::ElementsAre(0, 2));
  EXPECT_EQ(log.incomplete_ticks(), 1);
  EXPECT_THAT(log.estimators(), testing::ElementsAre("ekf13"));
  EXPECT_EQ(log.run().config_toml, "a = 1");
}

TEST(RunLog, ATickWithAMessageThatCannotBeReadIsLeftOut) {
  const std::string channel = "EQUIPOISE_MOTORS";
  std::string other_type = tick_events(1);
  other_type[other_type.find(channel) + channel.size()] ^= 1;  // the fingerprint of its type
  RunLog log(run_event() + tick_events(0) + other_type + tick_events(2), "a.lcm");
  std::vector<std::int64_t> ticks;
  for (TickRecord tick; log.next(&tick);) ticks.push_back(tick.tick);
  EXPECT_THAT(ticks, testing::ElementsAre(0, 2));
  EXPECT_EQ(log.incomplete_ticks(), 1);
}

std::string message(const std::string& channel, const runtime::StateRecord& x, std::int64_t tick) {
  Bytes bytes;
  runtime::encode(fields::State{}, x, 5000 * tick, tick, &bytes);
  return event(channel, bytes);
}

std::string end_message(std::int64_t tick) {
  runtime::EndRecord end;
  end.ended = 2;
  end.duration_s = 4.5;
  Bytes bytes;
  runtime::encode(fields::End{}, end, 5000 * tick, tick, &bytes);
  return event(fields::kEndChannel, bytes);
}

TEST(RunLog, AMessageOfAnotherTickBelongsToNone) {
  RunLog log(run_event() + tick_events(0, "EQUIPOISE_REFERENCE") + message("EQUIPOISE_REFERENCE", {}, 9) +
                 tick_events(1, fields::kTruthChannel) + message(fields::kTruthChannel, {}, 0) +
                 message("EQUIPOISE_STATE_LATE", {}, 0) + end_message(0),
             "a.lcm");
  TickRecord tick;
  ASSERT_TRUE(log.next(&tick));
  EXPECT_EQ(tick.tick, 1);
  EXPECT_FALSE(tick.has_truth);
  EXPECT_EQ(tick.compared, 1U);
  EXPECT_FALSE(log.next(&tick));
  EXPECT_EQ(log.incomplete_ticks(), 1) << "the first, whose reference is another tick's";
  EXPECT_THAT(log.estimators(), testing::ElementsAre("ekf13"));
  EXPECT_FALSE(log.end());
}

TEST(RunLog, TheEndIsTheRunsOwnJudgement) {
  RunLog log(run_event() + tick_events(0) + tick_events(1) + end_message(1), "a.lcm");
  int ticks = 0;
  for (TickRecord tick; log.next(&tick);) ++ticks;
  EXPECT_EQ(ticks, 2);
  ASSERT_TRUE(log.end());
  EXPECT_EQ(log.end()->ended, 2);
  EXPECT_EQ(log.end()->duration_s, 4.5);
}

TEST(RunLog, WhatWasWeighedIsInTheTicksThatHaveIt) {
  FaultEvidence faults;
  faults.leading = 20;
  faults.ratio = 21.5;
  faults.bound = 18.6;
  faults.decided = true;
  faults.verdicts = 1U << 20U;
  Bytes bytes;
  runtime::encode(fields::Faults{}, faults, 0, 0, &bytes);
  const std::string weighed = event(fields::kFaultsChannel, bytes);
  RunLog log(run_event() + tick_events(0) + weighed + tick_events(1) + weighed + tick_events(2), "a.lcm");
  TickRecord tick;
  ASSERT_TRUE(log.next(&tick));
  EXPECT_EQ(tick.faults.leading, 20);
  EXPECT_EQ(tick.faults.ratio, 21.5);
  EXPECT_TRUE(tick.faults.decided);
  EXPECT_EQ(tick.faults.verdicts, 1U << 20U);
  for (int without = 1; without <= 2; ++without) {  // another tick's, and an older log's
    ASSERT_TRUE(log.next(&tick));
    EXPECT_EQ(tick.faults.bound, 0.0) << without;
    EXPECT_FALSE(tick.faults.decided) << without;
  }
  EXPECT_EQ(log.incomplete_ticks(), 0);
}

TEST(RunLog, EachEstimatorKeepsItsPlaceAndOnlySoManyHaveOne) {
  std::string bytes = run_event() + tick_events(0);
  for (int i = 1; i < 10; ++i) {
    runtime::StateRecord x{};
    x.theta_rad[0] = i;
    bytes += message("EQUIPOISE_STATE_E" + std::to_string(i), x, 0);
  }
  runtime::StateRecord second{};
  second.theta_rad[0] = 20.0;
  bytes += tick_events(1, "EQUIPOISE_STATE_EKF13") + message("EQUIPOISE_STATE_E2", second, 1);
  RunLog log(bytes, "a.lcm");
  TickRecord tick;
  ASSERT_TRUE(log.next(&tick));
  EXPECT_EQ(tick.compared, 0xFFU);
  for (std::size_t i = 1; i < 8; ++i) EXPECT_EQ(tick.others[i].theta_rad[0], static_cast<double>(i));
  ASSERT_TRUE(log.next(&tick));
  EXPECT_EQ(tick.compared, 1U << 2U);
  EXPECT_EQ(tick.others[2].theta_rad[0], 20.0);
  EXPECT_THAT(log.estimators(), testing::ElementsAre("ekf13", "e1", "e2", "e3", "e4", "e5", "e6", "e7"));
}

// The first part of a log may be gone, and a run may be cut off.
TEST(RunLog, ATickWithoutItsBeginningIsNoneAndOneWithoutItsEndIsIncomplete) {
  const std::string sensors = fields::kSensorsChannel;
  RunLog log(run_event() + tick_events(0, sensors) + tick_events(1) + tick_events(2, "EQUIPOISE_TIMING") +
                 tick_events(3, "EQUIPOISE_COMMAND"),
             "a.lcm");
  std::vector<std::int64_t> ticks;
  for (TickRecord tick; log.next(&tick);) ticks.push_back(tick.tick);
  EXPECT_THAT(ticks, testing::ElementsAre(1));
  EXPECT_EQ(log.incomplete_ticks(), 2);
}

TEST(RunLog, DamageBetweenEventsIsSkippedAndCounted) {
  const std::string noise(700000, 'x');  // more than one read
  RunLog log(noise + run_event() + tick_events(0) + noise + tick_events(1) + "\xED\xA1\xDA", "a.lcm");
  int ticks = 0;
  for (TickRecord tick; log.next(&tick);) ++ticks;
  EXPECT_EQ(ticks, 2);
  EXPECT_EQ(log.damaged_bytes(), 2 * noise.size() + 3);
}

// Found by fuzzing: a length that counts no end.
TEST(RunLog, AStringWithoutRoomForItsEndIsRefused) {
  constexpr std::size_t kRobotLength = 32;  // fingerprint, utime, seed, rolling radius come before
  Bytes bytes = run_message();
  ASSERT_EQ(bytes[kRobotLength + 3], 5U);
  for (const std::int32_t length : {0, -1, -5, std::numeric_limits<std::int32_t>::min()}) {
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[kRobotLength + i] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(length) >> (24 - 8 * i));
    }
    EXPECT_THROW(RunLog(event(fields::kRunChannel, bytes), "a.lcm"), InputError) << length;
  }
}

}  // namespace
}  // namespace equipoise::app
