// An uneven floor against its formulas: height of an edge, momentum lost at it, slope that is a gradient; and
// one robot on each.
#include "equipoise/plant/ground.hpp"

#include <gtest/gtest.h>

#include "robots/mbbr/world.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {
namespace {

constexpr double kRadius_m = 0.032;

FloorParams sills(double height_m) {
  FloorParams floor;
  floor.sill_m = height_m;
  floor.sill_every_m = 0.4;  // the first at 0.2 m
  return floor;
}

TEST(Ground, ASillLiftsTheCentreByItsHeightAndLetsItDownAgain) {
  for (const double height : {0.0005, 0.001, 0.002}) {
    const Ground ground(sills(height), kRadius_m, 1);
    double rise = 0.0;
    double highest = 0.0;
    constexpr double kStep_m = 1e-5;
    for (double x = 0.1; x < 0.3; x += kStep_m) {
      rise += kStep_m * ground.slope(Vec2(x, 0.3)).x();
      highest = std::max(highest, rise);
    }
    EXPECT_NEAR(highest, height, 0.02 * height);
    EXPECT_NEAR(rise, 0.0, 0.02 * height);
    // The centre meets it sqrt(2 r h - h^2) before, as steep as asin of that over r.
    const double reach = std::sqrt(2.0 * kRadius_m * height - height * height);
    EXPECT_EQ(ground.slope(Vec2(0.2 - 1.001 * reach, 0.0)).x(), 0.0);
    EXPECT_NEAR(ground.slope(Vec2(0.2 - 0.999 * reach, 0.0)).x(), std::tan(std::asin(reach / kRadius_m)),
                1e-3);
  }
}

TEST(Ground, AnEdgeTakesWhatIsNotAlongItsTangent) {
  // Plastic impact: of v keeps v cos^2 a along the floor, cos a = 1 - h / r; a share 2 h / r is lost.
  constexpr double kHeight_m = 0.001;
  constexpr double kSpeed_m_s = 0.2;
  constexpr double kStep_s = 1e-4;
  Ground ground(sills(kHeight_m), kRadius_m, 1);
  double lost = 0.0;
  double lifted = 0.0;
  for (double x = 0.15; x < 0.2; x += kSpeed_m_s * kStep_s) {
    ground.begin_step(Vec2(x, 0.0), Vec2(kSpeed_m_s, 0.0), kStep_s);
    lost -= kStep_s * (ground.pull_W_m_s2().x() + kGravity_m_s2 * ground.slope(Vec2(x, 0.0)).x());
    lifted = std::max(lifted, kStep_s * ground.lift_m_s2());
  }
  EXPECT_NEAR(lost / kSpeed_m_s, 2.0 * kHeight_m / kRadius_m, 0.005);
  EXPECT_NEAR(lifted / kSpeed_m_s, std::sqrt(2.0 * kHeight_m / kRadius_m), 0.01);  // sin a
}

TEST(Ground, JointsAreStepsOfNoMoreThanTheyMay) {
  FloorParams floor;
  floor.joint_m = 0.0008;
  floor.heading_rad = 0.5;
  const Ground ground(floor, kRadius_m, 4);
  const Vec2 along(std::cos(0.5), std::sin(0.5));
  double height = 0.0;
  double highest = 0.0;
  double lowest = 0.0;
  for (double s = 0.0; s < 30.0; s += 1e-5) {
    height += 1e-5 * ground.slope(s * along).dot(along);
    highest = std::max(highest, height);
    lowest = std::min(lowest, height);
  }
  EXPECT_LT(highest - lowest, 1.05 * floor.joint_m);  // tiles of heights between 0 and that
  EXPECT_GT(highest - lowest, 0.7 * floor.joint_m);
}

TEST(Ground, WavesReachTheirSlope) {
  FloorParams floor;
  floor.wave_rad = 0.02;
  const Ground ground(floor, kRadius_m, 1);
  double steepest = 0.0;
  for (double x = 0.0; x < 2.0; x += 0.001) steepest = std::max(steepest, ground.slope(Vec2(x, 0.0)).x());
  EXPECT_NEAR(steepest, 0.02, 1e-4);
}

TEST(Ground, SlopesThatDoNotChangeGiveWhatAConstantSlopeGives) {
  // A wave as long as a street is a constant slope about its start.
  MbbrWorldParams waved;
  waved.common.initial_tilt_rad = 0.0;
  MbbrWorldParams sloping = waved;
  waved.common.floor.wave_rad = 0.02;
  waved.common.floor.wave_m = 1e3;
  sloping.common.floor_slope_rad =
      Ground(waved.common.floor, kRadius_m, waved.common.seed).slope(Vec2::Zero());
  const auto fallen = [](const MbbrWorldParams& p) {
    MbbrWorld world(MbbrParameters{}, MotorParameters{}, Calibration{}, p);
    MotorCommand on{};
    on.enable = true;
    for (int i = 0; i < 60; ++i) world.advance(on);
    return world.truth();
  };
  const MbbrEstimate a = fallen(waved);
  const MbbrEstimate b = fallen(sloping);
  EXPECT_GT(b.phi.norm(), 0.01);
  EXPECT_LT((a.phi - b.phi).norm(), 1e-3 * b.phi.norm());
  EXPECT_LT((a.theta_xy - b.theta_xy).norm(), 1e-3 * b.theta_xy.norm());
}

TEST(Ground, ASlopeUnderBothWheelsOfAnEdumipIsAConstantSlope) {
  MipWorldParams waved;
  waved.common.initial_tilt_rad = 0.0;
  MipWorldParams sloping = waved;
  waved.common.floor.wave_rad = 0.02;
  waved.common.floor.wave_m = 1e3;
  sloping.common.floor_slope_rad = Ground(waved.common.floor, 0.034, waved.common.seed).slope(Vec2::Zero());
  const auto fallen = [](const MipWorldParams& p) {
    MipWorld world(MipParameters{}, MotorParameters{}, Calibration{}, p);
    MotorCommand on{};
    on.enable = true;
    for (int i = 0; i < 40; ++i) world.advance(on);
    return world.truth();
  };
  const MipEstimate a = fallen(waved);
  const MipEstimate b = fallen(sloping);
  EXPECT_GT(std::abs(b.theta), 1e-4);
  EXPECT_NEAR(a.theta, b.theta, 1e-3 * std::abs(b.theta));
  EXPECT_NEAR(a.psi, 0.0, 1e-6);
}

TEST(Ground, ASillUnderOneWheelTurnsAnEdumipTowardsIt) {
  MipWorldParams p;
  p.common.initial_tilt_rad = 0.0;
  p.common.floor = sills(0.002);
  p.common.floor.sill_every_m = MipParameters{}.d + 0.008;  // lines a little beyond the wheels
  p.common.floor.heading_rad = 0.1;
  MipWorld world(MipParameters{}, MotorParameters{}, Calibration{}, p);
  MotorCommand on{};
  on.enable = true;
  for (int i = 0; i < 40; ++i) world.advance(on);
  EXPECT_GT(std::abs(world.truth().psi) + std::abs(world.truth().theta), 1e-4);
}

}  // namespace
}  // namespace equipoise
