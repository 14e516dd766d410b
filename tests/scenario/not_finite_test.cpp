// A value that is not finite, in any field the tick reads, leaves no trace. In a command it stops the motors
// in that tick; a sample is rejected, and only when that lasts the motors stop.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <vector>

#include "closed_loop.hpp"

namespace equipoise {
namespace {

struct Field {
  std::string name;
  std::uint32_t lasting;  // SafetyReason if it lasts; 0: the robot does without
  std::function<double&(RawSample&, Command&)> of;
};

void PrintTo(const Field& field, std::ostream* out) { *out << field.name; }

std::vector<Field> every_field() {
  std::vector<Field> fields;
  const auto add = [&fields](const std::string& name, std::uint32_t lasting, auto of) {
    fields.push_back({name, lasting, of});
  };
  for (std::size_t i = 0; i < 3; ++i) {
    add("gyro_counts_" + std::to_string(i), kImuStale,
        [i](RawSample& r, Command&) -> double& { return r.gyro_counts[i]; });
    add("accel_counts_" + std::to_string(i), kImuStale,
        [i](RawSample& r, Command&) -> double& { return r.accel_counts[i]; });
  }
  for (std::size_t i = 0; i < kMaxMotors; ++i) {
    add("encoder_counts_" + std::to_string(i), kEncoderStale,
        [i](RawSample& r, Command&) -> double& { return r.encoder_counts[i]; });
    add("attitude_wxyz_" + std::to_string(i), 0,
        [i](RawSample& r, Command&) -> double& { return r.attitude_wxyz[i]; });
  }
  add("battery_counts", kBatteryLow, [](RawSample& r, Command&) -> double& { return r.battery_counts; });
  for (int i = 0; i < 2; ++i) {
    add("velocity_W_m_s_" + std::to_string(i), kNotFinite,
        [i](RawSample&, Command& c) -> double& { return c.velocity_W_m_s(i); });
  }
  add("yaw_rate_rad_s", kNotFinite, [](RawSample&, Command& c) -> double& { return c.yaw_rate_rad_s; });
  return fields;
}

bool all_numbers(const StateView& v) {
  return v.theta_rad.allFinite() && v.omega_B_rad_s.allFinite() && v.phi_rad.allFinite() &&
         v.phi_dot_rad_s.allFinite();
}

const double kBad[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                       -std::numeric_limits<double>::infinity()};

/// Every estimator still knows something.
void expect_numbers(const ClosedLoop& loop) {
  for (std::size_t i = 0; i < MbbrEstimators::kCount; ++i) {
    const auto id = static_cast<MbbrEstimatorId>(i);
    EXPECT_TRUE(all_numbers(view(loop.pipeline.estimators().estimate(id), loop.config.robot)))
        << kMbbrEstimatorNames[i];
  }
}

template <class Wanted>
auto fields_that(Wanted wanted) {
  std::vector<Field> fields;
  for (const Field& field : every_field())
    if (wanted(field)) fields.push_back(field);
  return ::testing::ValuesIn(fields);
}

bool of_command(const Field& field) { return field.lasting == kNotFinite; }

std::string name(const ::testing::TestParamInfo<Field>& test) { return test.param.name; }

class NotFinite : public ::testing::TestWithParam<Field> {
 protected:
  static ClosedLoop compared() {
    ClosedLoopOptions options;
    options.compare = true;
    return ClosedLoop(options);
  }

  static ClosedLoop::Result armed_step(ClosedLoop& loop, double bad) {
    return loop.step(ClosedLoop::armed(),
                     [&](RawSample& raw, Command& command) { GetParam().of(raw, command) = bad; });
  }

  static void expect_upright(ClosedLoop& loop) {
    EXPECT_TRUE(loop.run(2.0, ClosedLoop::armed()).motors.enable);
    EXPECT_LT(loop.world.truth().theta_xy.norm(), 0.15);
    expect_numbers(loop);
  }
};

TEST_P(NotFinite, InEverySampleStopsTheMotorsWhereTheRobotNeedsIt) {
  ClosedLoop loop;
  ASSERT_TRUE(loop.balance(1.0).motors.enable);
  ClosedLoop::Result t;
  for (int i = 0; i < 450; ++i) t = armed_step(loop, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(t.motors.enable, GetParam().lasting == 0);
  EXPECT_EQ(t.reasons & GetParam().lasting, GetParam().lasting);
}

INSTANTIATE_TEST_SUITE_P(EveryField, NotFinite, ::testing::ValuesIn(every_field()), name);

class NotFiniteSample : public NotFinite {};

TEST_P(NotFiniteSample, OnceIsRejected) {
  for (const double bad : kBad) {
    SCOPED_TRACE(bad);
    ClosedLoop loop = compared();
    ASSERT_TRUE(loop.balance(1.0).motors.enable);
    EXPECT_TRUE(armed_step(loop, bad).motors.enable);
    expect_upright(loop);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryField, NotFiniteSample,
                         fields_that([](const Field& f) { return !of_command(f); }), name);

class NotFiniteCommand : public NotFinite {};

TEST_P(NotFiniteCommand, StopsTheMotorsInTheSameTickAndIsForgottenOnceFiniteAgain) {
  for (const double bad : kBad) {
    SCOPED_TRACE(bad);
    ClosedLoop loop = compared();
    ASSERT_TRUE(loop.balance(1.0).motors.enable);

    const ClosedLoop::Result hit = armed_step(loop, bad);
    EXPECT_FALSE(hit.motors.enable);
    for (const double duty : hit.motors.duty) EXPECT_EQ(duty, 0.0);
    EXPECT_EQ(hit.arm_state, ArmState::kFault);
    EXPECT_NE(hit.reasons & kNotFinite, 0U);

    // Asking on does not help; asking again does, once six encoder samples are good.
    EXPECT_FALSE(loop.step(ClosedLoop::armed()).motors.enable);
    for (int i = 0; i < 6; ++i) EXPECT_FALSE(loop.step(Command{}).motors.enable);
    EXPECT_TRUE(loop.step(ClosedLoop::armed()).motors.enable);
    expect_upright(loop);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryField, NotFiniteCommand, fields_that(of_command), name);

class NotFiniteFromTheStart : public NotFinite {};

TEST_P(NotFiniteFromTheStart, RefusesToArm) {
  ClosedLoop loop;
  loop.run(0.5, Command{});
  for (int i = 0; i < 20; ++i) {
    const ClosedLoop::Result t = armed_step(loop, std::numeric_limits<double>::quiet_NaN());
    ASSERT_FALSE(t.motors.enable);
    ASSERT_NE(t.reasons & GetParam().lasting, 0U);
  }
}

// A battery nobody can read is found out after two seconds; packets are not needed.
INSTANTIATE_TEST_SUITE_P(NeededField, NotFiniteFromTheStart, fields_that([](const Field& f) {
                           return f.lasting != kBatteryLow && f.lasting != 0;
                         }),
                         name);

}  // namespace
}  // namespace equipoise
