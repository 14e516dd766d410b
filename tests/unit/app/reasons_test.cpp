// The table of reasons: complete, in the order of the bits, and in numbers where the tick has them.
#include "app/text/reasons.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <set>

namespace equipoise::app {
namespace {

TEST(Reasons, EveryBitHasARowWithTextAndRemedy) {
  for (const auto* rows : {&safety_reasons(), &degraded_modes()}) {
    std::set<std::string> names;
    std::uint32_t bit = 1;
    for (const Reason& row : *rows) {
      EXPECT_EQ(row.bit, bit) << row.name;
      EXPECT_GT(std::strlen(row.text), 8U) << row.name;
      EXPECT_GT(std::strlen(row.remedy), 8U) << row.name;
      names.insert(row.name);
      bit <<= 1;
    }
    EXPECT_EQ(names.size(), rows->size());
  }
  EXPECT_EQ(safety_reasons().back().bit, kMotorFault) << "the last of SafetyReason";
  EXPECT_EQ(degraded_modes().back().bit, kGyroBiasJumped) << "the last of DegradedBit";
}

TEST(Reasons, KeepTheirNames) {
  EXPECT_EQ(reasons_text(kGuardDead | kWheelSlip | kWheelFour), "guard_dead, wheel_slip, wheel_4");
  EXPECT_EQ(degraded_names(kWithoutImu | kWithoutWheelTwo),
            (std::vector<std::string>{"without_imu", "without_wheel_2"}));
}

ReasonNumbers numbers() {
  runtime::TickRecord tick{};
  tick.estimate.theta_rad = {0.31, 0.0, 2.0};  // the heading has no say
  tick.estimate.omega_B_rad_s = {3.0, 4.0, 0.0};
  tick.estimate.normalized_innovation = 7.5;
  tick.battery_V = 5.9;
  tick.command_age_s = 0.75;
  return reason_numbers(tick);
}

std::string explained(std::uint32_t reason, const ReasonNumbers& numbers) {
  const auto lines = reasons_explained(reason, numbers, SafetyParams{});
  return lines.size() == 1 ? lines[0] : "";
}

TEST(Reasons, NameNumberLimitAndRemedy) {
  EXPECT_EQ(explained(kTilt, numbers()), "tilt 0.31 rad, limit 0.20 rad: hold it upright before arming");
  EXPECT_EQ(explained(kGyroMoving, numbers()).rfind("body rate 5.00 rad/s, limit 2.00 rad/s: ", 0), 0U);
  EXPECT_EQ(explained(kBatteryLow, numbers()).rfind("battery 5.90 V, limit 6.00 V: ", 0), 0U);
  EXPECT_EQ(explained(kEstimatorUnhealthy, numbers()).rfind("normalised innovation 7.50, limit 2.50: ", 0),
            0U);
  EXPECT_EQ(explained(kCommandStale, numbers()).rfind("age of the command 0.75 s, limit 0.50 s: ", 0), 0U);
}

TEST(Reasons, AnArmedRobotHasOtherLimits) {
  ReasonNumbers n = numbers();
  n.was_armed = true;  // 0.31 rad may be; at 3 rad/s, 0.12 s ahead, it goes to (0.67, 0.48)
  EXPECT_EQ(explained(kTilt, n).rfind("tilt that it falls to 0.82 rad, limit 0.60 rad: ", 0), 0U);
  n.tilt_rad = 0.61;
  EXPECT_EQ(explained(kTilt, n).rfind("tilt 0.61 rad, limit 0.60 rad: ", 0), 0U);
}

TEST(Reasons, WithoutANumberSayWhatTheyMean) {
  EXPECT_EQ(explained(kGuardDead, numbers()),
            "guard_dead: the guard process ended or hangs; see the journal; restart run");
  ReasonNumbers charged = numbers();
  charged.battery_V = 8.0;  // not this number
  EXPECT_EQ(explained(kBatteryLow, charged).rfind("battery_low: ", 0), 0U);
}

}  // namespace
}  // namespace equipoise::app
