// The judge of runs with a fault, by robots that do what a test says: one row for everything that is unsafe,
// and for what is just not.
#include "app/evaluate/fault_run.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "equipoise/actuate/degraded.hpp"

namespace equipoise::app {
namespace {

constexpr int kFault = 120;  // tick
constexpr double kMaxTilt_rad = 0.6;

/// Stands, unless a test says otherwise.
class ScriptedWorld final : public World {
 public:
  void advance(const MotorCommand&) override { time_s_ += kTickS; }
  RawSample sense() override {
    RawSample s{};
    s.valid = RIO_IMU | RIO_ENCODERS;
    return s;
  }
  double time_s() const noexcept override { return time_s_; }
  void without_attitude() noexcept override {}
  StateView truth() const noexcept override { return state; }
  StateView state;

 private:
  double time_s_ = 0.0;
};

/// `told`: of tick n, what the robot does and how it moves.
using Told = std::function<void(int n, runtime::TickRecord& t, StateView& truth)>;

class ScriptedFirmware final : public Firmware {
 public:
  ScriptedFirmware(ScriptedWorld& world, const Told& told) : world_(world), told_(told) {}
  runtime::TickRecord tick(const RawSample& raw, const Command& asked, const LoopState&) noexcept override {
    runtime::TickRecord t{};
    t.raw = raw;
    t.arm = t.motors.enable = asked.arm;
    t.arm_state = static_cast<std::int32_t>(asked.arm ? ArmState::kArmed : ArmState::kDisarmed);
    t.reasons = asked.arm ? 0U : kNotRequested;
    t.velocity_W_m_s = {asked.velocity_W_m_s.x(), asked.velocity_W_m_s.y()};
    t.yaw_rate_rad_s = asked.yaw_rate_rad_s;
    t.command_age_s = asked.age_s;
    if (told_) told_(n_, t, world_.state);
    ++n_;
    return t;
  }
  bool runs(std::size_t) const noexcept override { return false; }
  bool reads_attitude() const noexcept override { return false; }
  StateErrors errors_of(const StateView&, const StateView&) const noexcept override { return {}; }
  void observe_truth(const World&) noexcept override {}
  void observe_truth(const runtime::StateRecord&) noexcept override {}

 private:
  ScriptedWorld& world_;
  Told told_;
  int n_ = 0;
};

FaultPlan plan_of(FaultKind fault, Phase phase = Phase::kBalancing) {
  FaultPlan plan;
  plan.phase = phase;
  plan.fault = fault;
  plan.fault_at_tick = kFault;
  plan.end_tick = kFault + 300;
  return plan;
}

FaultOutcome run(const FaultPlan& plan, const Told& told,
                 const std::function<void(const runtime::TickRecord&)>& observe = {}) {
  ScriptedWorld world;
  ScriptedFirmware firmware(world, told);
  return run_with_fault(world, firmware, plan, kMaxTilt_rad, 1, observe);
}

void off(runtime::TickRecord& t, std::uint32_t reasons) {
  t.motors.enable = false;
  t.arm_state = static_cast<std::int32_t>(ArmState::kFault);
  t.reasons = reasons;
}

/// From one tick to another, without the last.
bool in(int n, int from, int to) { return n >= from && n < to; }

struct Row {
  const char* why;  // "": safe
  FaultKind fault;
  Told told;
  int fault_ticks = 1 << 20;
  Phase phase = Phase::kBalancing;
};

Told tilted(double tilt_rad, int ticks) {
  return [=](int n, auto& t, StateView& truth) {
    truth.theta_rad.x() = t.estimate.theta_rad[0] = in(n, 130, 130 + ticks) ? tilt_rad : 0.0;
  };
}
Told wrong(double error_rad, int ticks) {
  return [=](int n, auto& t, StateView&) {
    t.estimate.theta_rad[1] = in(n, 130, 130 + ticks) ? error_rad : 0.0;
  };
}
Told off_from(int tick, int on_again = 1 << 20, std::uint32_t reasons = kImuStale) {
  return [=](int n, auto& t, StateView&) {
    if (in(n, tick, on_again)) off(t, reasons);
  };
}
Told rolling(double m_s, int from = kFault) {
  return [=](int n, auto&, StateView& truth) {
    if (n >= from) truth.position_W_m.y() += m_s * kTickS;
  };
}

const Row kRows[] = {
    {"", FaultKind::kRemoteLost, {}},
    {"", FaultKind::kRemoteLost, tilted(0.7, 3)},
    {"motors on after a fall", FaultKind::kRemoteLost, tilted(0.7, 4)},
    {"motors on after a fall", FaultKind::kRemoteLost, tilted(-0.601, 4)},
    {"", FaultKind::kRemoteLost, tilted(0.6, 50)},
    {"", FaultKind::kRemoteLost, wrong(0.36, 3)},
    {"wrong tilt unnoticed", FaultKind::kRemoteLost, wrong(0.36, 4)},
    {"wrong tilt unnoticed", FaultKind::kRemoteLost, wrong(NAN, 4)},
    {"", FaultKind::kRemoteLost, wrong(-0.34, 50)},
    {"duty after the deadline", FaultKind::kLogFull, {}},
    {"duty after the deadline", FaultKind::kLogFull, off_from(kFault + 3)},
    {"", FaultKind::kLogFull, off_from(kFault + 2)},
    {"", FaultKind::kLogFull, {}, 1},
    {"duty after the deadline", FaultKind::kImuOff, off_from(kFault + kBlindTicks + 1)},
    {"", FaultKind::kImuOff, off_from(kFault + kBlindTicks)},
    {"armed again by itself", FaultKind::kRemoteLost, off_from(140, 145)},
    {"motors off without a reason", FaultKind::kRemoteLost, off_from(140, 1 << 20, 0)},
    {"motors on unasked", FaultKind::kRemoteLost, [](int n, auto& t, auto&) { t.motors.enable = n == 140; },
     9, Phase::kDisarmed},
    {"too fast", FaultKind::kRemoteLost, rolling(0.61)},
    {"", FaultKind::kRemoteLost, rolling(0.59, kFault + 250)},
    {"unasked travel", FaultKind::kRemoteLost, rolling(0.35)},
    {"", FaultKind::kRemoteLost, rolling(0.33)},
    {"", FaultKind::kRemoteLost,
     [](int n, auto&, StateView& s) { s.position_W_m.x() = n <= kFault ? 9.0 : 9.4; }, 9, Phase::kDisarmed},
};

TEST(FaultJudge, KnowsWhatIsUnsafe) {
  for (std::size_t i = 0; i < std::size(kRows); ++i) {
    const Row& row = kRows[i];
    FaultPlan plan = plan_of(row.fault, row.phase);
    plan.fault_ticks = row.fault_ticks;
    const FaultOutcome out = run(plan, row.told);
    EXPECT_EQ(std::string(out.why), row.why) << "row " << i;
    EXPECT_EQ(out.unsafe, *row.why != 0) << "row " << i;
  }
}

TEST(FaultJudge, WhatWasAskedForIsNoUnaskedTravel) {
  EXPECT_EQ(std::string(run(plan_of(FaultKind::kBiasJump, Phase::kDriving), rolling(0.39)).why), "");
  EXPECT_EQ(std::string(run(plan_of(FaultKind::kBiasJump, Phase::kDriving), rolling(0.42)).why),
            "unasked travel");
}

TEST(FaultJudge, ARobotThatNothingHappensToStandsToTheEnd) {
  int ticks = 0;
  const FaultOutcome out =
      run(plan_of(FaultKind::kRemoteLost), {}, [&](const auto& t) { EXPECT_EQ(t.tick, ticks++); });
  EXPECT_EQ(ticks, kFault + 300);
  EXPECT_TRUE(out.upright);
  EXPECT_FALSE(out.disarmed || out.off_without_fault);
  EXPECT_EQ(out.off_after_ticks, -1);
  EXPECT_EQ(out.found_after_ticks, -1);
  EXPECT_EQ(out.reasons + out.degraded, 0U);
  EXPECT_FALSE(run(plan_of(FaultKind::kRemoteLost), tilted(0.61, 1000)).upright);
  EXPECT_FALSE(run(plan_of(FaultKind::kRemoteLost, Phase::kDisarmed), {}).upright);
}

TEST(FaultJudge, TellsWhenAndWhyTheMotorsWentOff) {
  const FaultOutcome out = run(plan_of(FaultKind::kRemoteLost), off_from(kFault + 7));
  EXPECT_TRUE(out.disarmed);
  EXPECT_FALSE(out.upright || out.off_without_fault);
  EXPECT_EQ(out.off_after_ticks, 8);
  EXPECT_EQ(out.found_after_ticks, 8);
  EXPECT_EQ(out.reasons, kImuStale);
  EXPECT_TRUE(run(plan_of(FaultKind::kRemoteLost), off_from(kFault - 1)).off_without_fault);
  EXPECT_FALSE(run(plan_of(FaultKind::kRemoteLost), off_from(kFault)).off_without_fault);
  const FaultOutcome never = run(plan_of(FaultKind::kRemoteLost), off_from(0, 1 << 20, kBatteryLow));
  EXPECT_FALSE(never.disarmed);
  EXPECT_EQ(never.reasons, kBatteryLow) << "why it never armed";
}

TEST(FaultJudge, ATickWithoutDutyIsNoDisarming) {
  const FaultOutcome out = run(plan_of(FaultKind::kStall20ms), [](int n, auto& t, auto&) {
    t.motors.enable = t.arm && n != kFault;
    if (n == kFault) t.reasons = kOverrun;
  });
  EXPECT_FALSE(out.disarmed || out.unsafe);
  EXPECT_TRUE(out.upright);
}

TEST(FaultJudge, AFaultIsFoundByADetectorNotByAGap) {
  const FaultOutcome out = run(plan_of(FaultKind::kRemoteLost), [](int n, auto& t, auto&) {
    t.degraded = 0;
    if (n < kFault) t.degraded = kWithoutWheelTwo;
    if (in(n, kFault, kFault + 5)) t.degraded = kWithoutImu;
    if (in(n, kFault + 5, kFault + 9)) t.degraded = kGyroBiasJumped;
  });
  EXPECT_EQ(out.found_after_ticks, 6);
  EXPECT_EQ(out.degraded, kWithoutImu | kGyroBiasJumped);
}

TEST(FaultRun, BreaksFromItsTickOnForAsLongAsItsRowSays) {
  std::vector<std::int64_t> without;
  run(plan_of(FaultKind::kImuGap), {}, [&](const auto& t) {
    if ((t.raw.valid & RIO_IMU) == 0) without.push_back(t.tick);
  });
  ASSERT_EQ(without.size(), 20U);
  EXPECT_EQ(without.front(), kFault);
  double oldest_s = 0.0;
  FaultPlan plan = plan_of(FaultKind::kRemoteLost);
  plan.fault_ticks = 12;
  run(plan, {}, [&](const auto& t) { oldest_s = std::max(oldest_s, t.command_age_s); });
  EXPECT_NEAR(oldest_s, 12 * kTickS, 1e-6);
}

TEST(FaultRun, PhasesAreWhatTheySay) {
  const struct {
    Phase phase;
    bool arm;
    double yaw_rate_rad_s, speed_m_s;
  } rows[] = {{Phase::kDisarmed, false, 0.0, 0.0}, {Phase::kArming, true, 0.0, 0.0},
              {Phase::kBalancing, true, 0.0, 0.0}, {Phase::kSpinning, true, 2.0 * kPi, 0.0},
              {Phase::kDriving, true, 0.0, 0.1},   {Phase::kSpinDriving, true, 2.0 * kPi, 0.1}};
  for (const auto& row : rows) {
    run(plan_of(FaultKind::kImuGap, row.phase), {}, [&row](const auto& t) {
      EXPECT_EQ(t.arm, row.arm && t.tick >= 100);
      EXPECT_EQ(t.yaw_rate_rad_s, t.tick > 200 ? row.yaw_rate_rad_s : 0.0);
      EXPECT_EQ(t.velocity_W_m_s[0], t.tick > 200 ? row.speed_m_s : 0.0);
      EXPECT_EQ(t.velocity_W_m_s[1], 0.0);
    });
  }
}

}  // namespace
}  // namespace equipoise::app
