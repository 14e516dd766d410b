// Robots in vector registers against the same robots one by one.
#include "equipoise/plant/lanes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "robots/lanes/roll.hpp"
#include "robots/mbbr/world.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {
namespace {

struct Two {
  static constexpr int kLanes = 2;
  using Vector = double __attribute__((vector_size(16)));
  using Bits = long long __attribute__((vector_size(16)));
  using Unsigned = unsigned long long __attribute__((vector_size(16)));
};

Lanes<Two> two(double a, double b) { return Lanes<Two>(Two::Vector{a, b}); }

TEST(Lanes, LogarithmIsExactToTheLastDigits) {
  for (double x = 1e-18; x < 1e12; x *= 1.37) {
    const Lanes<Two> log = log1p(two(x, 0.0));
    EXPECT_NEAR(log[0], std::log1p(x), 4e-16 * std::log1p(x)) << x;
    EXPECT_EQ(log[1], 0.0);
  }
}

TEST(Lanes, SinesAreExactToTheLastDigits) {
  for (double x = 1e-12; x < 1e6; x *= 1.031) {
    EXPECT_NEAR(sin(two(x, -x))[0], std::sin(x), 3e-16) << x;
    EXPECT_NEAR(sin(two(x, -x))[1], -std::sin(x), 3e-16) << x;
    EXPECT_NEAR(cos(two(x, -x))[0], std::cos(x), 3e-16) << x;
    EXPECT_NEAR(cos(two(x, -x))[1], std::cos(x), 3e-16) << x;
  }
}

TEST(Lanes, AChoiceIsMadeInEachLane) {
  const Lanes<Two> a = two(1.0, -3.0);
  EXPECT_EQ(abs(a)[1], 3.0);
  const Lanes<Two> chosen = select(a < Lanes<Two>(0.0), Lanes<Two>(7.0), a);
  EXPECT_EQ(chosen[0], 1.0);
  EXPECT_EQ(chosen[1], 7.0);
  EXPECT_FALSE(all(a < Lanes<Two>(0.0)));
  EXPECT_TRUE(all(a < Lanes<Two>(2.0)));
}

void unlike(WorldParams* common, std::uint64_t seed) {
  common->seed = seed;
  common->battery_resistance_ohm = 0.15;
  common->actual.body_mass = 1.0 + 0.01 * static_cast<double>(seed);
}

struct OfMbbr {
  using World = MbbrWorld;
  static World world(std::uint64_t seed) {
    MbbrWorldParams p;
    unlike(&p.common, seed);
    p.yaw_friction_scale = Vec2(1.1, 0.9);
    return {MbbrParameters{}, MotorParameters{}, Calibration{}, p};
  }
  static Vec<20> numbers(World& world) {
    const MbbrEstimate x = world.truth();
    const RawSample felt = world.sense();
    Vec<20> v;
    v << x.theta_xy, x.theta_z, x.omega_B, x.phi_dot_star, x.phi, world.battery_V(),
        Eigen::Map<const Vec3>(felt.gyro_counts), Eigen::Map<const Vec3>(felt.accel_counts) / 1000.0,
        Eigen::Map<const Vec3>(felt.encoder_counts);
    return v;
  }
};

struct OfMip {
  using World = MipWorld;
  static World world(std::uint64_t seed) {
    MipWorldParams p;
    unlike(&p.common, seed);
    p.drivetrain.motor_gain = Vec2(1.06, 0.94);
    p.drivetrain.friction_gain = Vec2(0.8, 1.2);
    p.drivetrain.gear.play_rad = 0.01;
    MipParameters robot;
    robot.mu_c = 0.006;
    robot.mu_v = 1e-4;
    MotorParameters motor;
    motor.bridge = BridgeType::kDriveBrake;
    return {robot, motor, Calibration{}, p};
  }
  static Vec<9> numbers(World& world) {
    const MipEstimate x = world.truth();
    Vec<9> v;
    v << x.theta, x.phi, x.psi, x.theta_dot, x.phi_dot, x.psi_dot, x.position_W_m, world.battery_V();
    return v;
  }
};

template <class Robot>
class Together : public testing::Test {
 protected:
  using World = typename Robot::World;
  using Rolling = typename World::Rolling;
  static constexpr std::size_t kCount = 7;  // fills no instruction set's registers

  /// Random duties for 0.3 s, each robot its own: tilted, turning, sticking and sliding. False: no such
  /// processor.
  bool rolls(const char* isa) {
    std::vector<World> alone;
    std::vector<World> together;
    for (std::uint64_t seed = 1; seed <= kCount; ++seed) {
      alone.push_back(Robot::world(seed));
      together.push_back(Robot::world(seed));
    }
    std::mt19937 random(7);
    std::uniform_real_distribution<double> duty(-0.5, 0.5);
    std::array<Rolling, kCount> numbers{};
    std::array<Rolling*, kCount> places{};
    for (std::size_t i = 0; i < kCount; ++i) places[i] = &numbers[i];
    for (int tick = 0; tick < 60; ++tick) {
      for (std::size_t i = 0; i < kCount; ++i) {
        MotorCommand c{};
        c.enable = true;
        for (std::size_t k = 0; k < 3; ++k) c.duty[k] = tick % 7 == 0 ? 0.0 : duty(random);
        alone[i].advance(c);
        EXPECT_TRUE(together[i].begin_rolling(c, places[i]));
      }
      const World& any = together[0];
      if (!roll_together_by(isa, places.data(), kCount, any.bridge(), any.steps_per_tick(), any.step_s()))
        return false;
      for (std::size_t i = 0; i < kCount; ++i) {
        together[i].end_rolling(numbers[i]);
        const auto error = (Robot::numbers(alone[i]) - Robot::numbers(together[i])).eval();
        EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-9) << "tick " << tick << ", robot " << i;
        EXPECT_EQ(alone[i].time_s(), together[i].time_s());
      }
      if (this->HasFailure()) break;
    }
    return true;
  }
};

using Robots = testing::Types<OfMbbr, OfMip>;
TYPED_TEST_SUITE(Together, Robots, );

TYPED_TEST(Together, RollAsEachAloneInBaselineRegisters) { EXPECT_TRUE(this->rolls("baseline")); }
TYPED_TEST(Together, RollAsEachAloneInAvx2Registers) {
  if (!this->rolls("avx2")) GTEST_SKIP() << "this processor has none";
}
TYPED_TEST(Together, RollAsEachAloneInAvx512Registers) {
  if (!this->rolls("avx512")) GTEST_SKIP() << "this processor has none";
}

TYPED_TEST(Together, ARobotThatIsHeldStepsItsOwnWorld) {
  auto world = TypeParam::world(1);
  typename TypeParam::World::Rolling numbers;
  EXPECT_FALSE(world.begin_rolling(MotorCommand{}, &numbers));
}

/// What Rolling leaves out, on one at a time.
TEST(TogetherNot, WhereMoreIsOn) {
  MbbrRollingOf<double> mbbr;
  MotorCommand on{};
  on.enable = true;
  const auto rolls = [&](auto&& change) {
    MbbrWorldParams p;
    change(p);
    return MbbrWorld(MbbrParameters{}, MotorParameters{}, Calibration{}, p).begin_rolling(on, &mbbr);
  };
  EXPECT_TRUE(rolls([](auto&) {}));
  EXPECT_FALSE(rolls([](auto& p) { p.common.pushes.push_back({}); }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.floor_slope_rad.x() = 0.01; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.rolling_resistance = 0.01; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.stiction.static_ratio = 1.2; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.diode_drop_V = 0.5; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.actuation_delay_ticks = 0.1; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.imu_low_pass = 3; }));
  EXPECT_FALSE(rolls([](auto& p) { p.common.encoder_sample_age_s = 1e-3; }));
  EXPECT_FALSE(rolls([](auto& p) { p.drive.wheel_torque_scale.x() = 1.1; }));
  EXPECT_FALSE(rolls([](auto& p) { p.drive.gear.play_rad = 0.01; }));
  EXPECT_FALSE(rolls([](auto& p) { p.drive.roller_tilt_rad = 0.1; }));
  EXPECT_FALSE(rolls([](auto& p) { p.drive.roller_slip_N_m = 0.01; }));
  EXPECT_FALSE(rolls([](auto& p) { p.drive.wheel_grip = 0.8; }));
  EXPECT_FALSE(rolls([](auto& p) { p.floor.grip = 0.8; }));
  MipWorldParams lifted;
  lifted.lift_at_s = 1.0;
  MipRollingOf<double> mip;
  EXPECT_FALSE(MipWorld(MipParameters{}, MotorParameters{}, Calibration{}, lifted).begin_rolling(on, &mip));
}

}  // namespace
}  // namespace equipoise
