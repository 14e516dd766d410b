#include "app/trial/path.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "app/text/errors.hpp"

namespace equipoise::app {
namespace {

constexpr PathLimits kAnything{10.0, 100.0, 100.0};
constexpr double kSpeed_m_s = 0.1;

std::string waypoint_file(const std::string& text) {
  const std::string name = testing::TempDir() + "waypoints_" + std::to_string(::getpid());
  std::ofstream(name) << text;
  return name;
}

std::string refusal(const std::string& name, const PathLimits& limits) {
  try {
    (void)make_path(name, kSpeed_m_s, limits);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

class NamedPath : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, NamedPath, testing::Values("circle", "figure8", "square", "waltz"));

TEST_P(NamedPath, BeginsAtRestAlongXAndNeverExceedsItsSpeed) {
  const auto path = make_path(GetParam(), kSpeed_m_s, kAnything);
  EXPECT_EQ(path->at(0.0).velocity_W_m_s.norm(), 0.0);
  EXPECT_EQ(path->at(0.0).position_W_m.norm(), 0.0);
  EXPECT_EQ(path->at(0.0).yaw_rad, 0.0);
  const Vec2 soon = path->at(0.1).velocity_W_m_s.normalized();
  EXPECT_NEAR(soon.x(), 1.0, 1e-3);
  double fastest = 0.0;
  for (double t = 0.0; t < 120.0; t += 0.01) fastest = std::max(fastest, path->at(t).velocity_W_m_s.norm());
  EXPECT_NEAR(fastest, kSpeed_m_s, 1e-6);
}

TEST_P(NamedPath, VelocityAndYawRateAreTheDerivatives) {
  const auto path = make_path(GetParam(), kSpeed_m_s, kAnything);
  constexpr double h = 1e-4;
  for (double t = h; t < 120.0; t += 0.173) {
    const PathPoint before = path->at(t - h);
    const PathPoint after = path->at(t + h);
    const PathPoint at = path->at(t);
    EXPECT_LT(((after.position_W_m - before.position_W_m) / (2.0 * h) - at.velocity_W_m_s).norm(), 1e-5) << t;
    EXPECT_NEAR((after.yaw_rad - before.yaw_rad) / (2.0 * h), at.yaw_rate_rad_s, 1e-5) << t;
  }
}

TEST_P(NamedPath, ComesBackToItsStart) {
  const auto path = make_path(GetParam(), kSpeed_m_s, kAnything);
  double nearest = 1.0;
  for (double t = 10.0; t < 60.0; t += 0.005) nearest = std::min(nearest, path->at(t).position_W_m.norm());
  EXPECT_LT(nearest, 1e-3);
}

TEST_P(NamedPath, ARobotThatMovesAlongItsNoseFollowsIt) {
  const auto path = make_path(GetParam(), kSpeed_m_s, kAnything);
  Vec2 position = Vec2::Zero();
  double heading = 0.0;
  for (int tick = 0; tick < 60 * 200; ++tick) {
    const double t = tick * kTickS;
    const PathPoint point = along_its_nose(*path, t);
    const double turn = point.yaw_rate_rad_s * kTickS;
    position += kTickS * rotate(heading + 0.5 * turn, point.velocity_W_m_s);
    heading += turn;
    ASSERT_LT((position - path->at(t + kTickS).position_W_m).norm(), 2e-3) << t;
  }
}

/// Left, right, lowest and highest of its points.
std::array<double, 4> extent(const char* name) {
  const auto path = make_path(name, kSpeed_m_s, kAnything);
  std::array<double, 4> e{};
  for (double t = 0.0; t < 60.0; t += 0.01) {
    const Vec2 p = path->at(t).position_W_m;
    e = {std::min(e[0], p.x()), std::max(e[1], p.x()), std::min(e[2], p.y()), std::max(e[3], p.y())};
  }
  return e;
}

TEST(NamedPaths, AreAsLargeAsTheReferenceSays) {
  for (const char* round : {"circle", "waltz"}) {
    const auto [left, right, low, high] = extent(round);
    EXPECT_NEAR(left, -0.3, 1e-3) << round;
    EXPECT_NEAR(right, 0.3, 1e-3);
    EXPECT_NEAR(low, 0.0, 1e-9);
    EXPECT_NEAR(high, 0.6, 1e-3);
  }
  const auto [left, right, low, high] = extent("square");
  EXPECT_NEAR(right - left, 0.6, 1e-3);
  EXPECT_NEAR(left, -0.15, 1e-3) << "it begins behind a corner of 0.15 m";
  EXPECT_NEAR(low, 0.0, 1e-9);
  EXPECT_NEAR(high, 0.6, 1e-3);
  double farthest = 0.0;
  const auto eight = make_path("figure8", kSpeed_m_s, kAnything);
  for (double t = 0.0; t < 60.0; t += 0.01) {
    const Vec2 p = rotate(kPi / 4.0, eight->at(t).position_W_m);
    farthest = std::max(farthest, std::abs(p.x()));
  }
  EXPECT_NEAR(farthest, 0.4, 1e-3) << "half its width";
}

TEST(NamedPaths, BeginSmoothlyWithinTwoSeconds) {
  for (const char* name : {"circle", "waltz", "square"}) {
    const auto path = make_path(name, kSpeed_m_s, kAnything);
    const auto speed = [&](double t_s) { return path->at(t_s).velocity_W_m_s.norm(); };
    EXPECT_NEAR(speed(0.5), 0.15625 * kSpeed_m_s, 1e-12) << name;  // x^2 (3 - 2x)
    EXPECT_NEAR(speed(1.0), 0.5 * kSpeed_m_s, 1e-12);
    EXPECT_NEAR(speed(2.0), kSpeed_m_s, 1e-12);
    EXPECT_EQ(speed(-1.0), 0.0);
  }
}

TEST(WaypointPath, IsTheClampedCubicSpline) {
  // 3 t^2 - 2 t^3 is at rest at 0 and 1: a clamped spline through its points is the cubic itself.
  const auto cubic = [](double t) { return t * t * (3.0 - 2.0 * t); };
  std::string text = "# time x y yaw\n";
  for (const double t : {0.0, 0.2, 0.35, 0.7, 1.0}) {
    char line[120];
    std::snprintf(line, sizeof line, "%.17g, %.17g, %.17g, %.17g\n", t, 1.0 + cubic(t), -2.0 * cubic(t),
                  0.5 * cubic(t));
    text += line;
  }
  const auto path = make_path(waypoint_file(text), kSpeed_m_s, kAnything);
  for (double t = 0.0; t <= 1.0; t += 0.01) {
    const PathPoint point = path->at(t);
    EXPECT_NEAR(point.position_W_m.x(), cubic(t), 1e-12);
    EXPECT_NEAR(point.position_W_m.y(), -2.0 * cubic(t), 1e-12);
    EXPECT_NEAR(point.yaw_rad, 0.5 * cubic(t), 1e-12);
    EXPECT_NEAR(point.velocity_W_m_s.x(), 6.0 * t * (1.0 - t), 1e-11);
  }
  const PathPoint after = path->at(3.0);
  EXPECT_NEAR(after.position_W_m.x(), 1.0, 1e-12);
  EXPECT_EQ(after.velocity_W_m_s.norm(), 0.0);
}

TEST(WaypointPath, TwoPointsAreEnough) {
  const auto path = make_path(waypoint_file("0 0 0 0\n4 1 0 0\n"), kSpeed_m_s, kAnything);
  EXPECT_NEAR(path->at(2.0).position_W_m.x(), 0.5, 1e-12);
  EXPECT_NEAR(path->at(2.0).velocity_W_m_s.x(), 0.375, 1e-12);  // 1.5 x the mean speed
}

TEST(WaypointPath, RefusesWhatIsWrong) {
  const auto refused = [](const char* text) { return refusal(waypoint_file(text), kAnything); };
  EXPECT_NE(refused("0 0 0 0\n1 2 3\n").find(":2: expected four numbers"), std::string::npos);
  EXPECT_NE(refused("0 0 0 0\n1 2 3 4 5\n").find(":2: expected four numbers"), std::string::npos);
  for (const char* value : {"nan", "inf", "1e999"})
    EXPECT_NE(
        refused((std::string("0 0 0 0\n1 0 0 ") + value + "\n").c_str()).find(":2: expected four numbers"),
        std::string::npos)
        << value;
  EXPECT_NE(refused("0.1 0 0 0\n1 0 0 0\n").find(":1: the first waypoint"), std::string::npos);
  EXPECT_NE(refused("0 0 0 0\n1 0 0 0\n1 0 0 0\n").find(":3: times must increase"), std::string::npos);
  EXPECT_NE(refused("0 0 0 0\n").find("two waypoints"), std::string::npos);
  EXPECT_NE(refusal("pentagon", kAnything).find("circle, figure8, square, waltz"), std::string::npos);
}

TEST(WaypointPath, RefusesWhatTheRobotCannotDo) {
  const std::string fast = waypoint_file("0 0 0 0\n1 1 0 0\n");
  EXPECT_NE(refusal(fast, {0.6, 100.0, 10.0}).find("m/s at"), std::string::npos);
  EXPECT_NE(refusal(fast, {2.0, 1.0, 10.0}).find("m/s^2 at"), std::string::npos);
  EXPECT_EQ(refusal(fast, {2.0, 7.0, 10.0}), "");
  const std::string turning = waypoint_file("0 0 0 0\n1 0 0 9\n");
  EXPECT_NE(refusal(turning, {2.0, 7.0, 10.0}).find("rad/s of yaw"), std::string::npos);
  EXPECT_NE(refusal("waltz", {2.0, 7.0, 1.0}).find("rad/s of yaw"), std::string::npos);
}

TEST(WaypointPath, ATimeThatNoTickReachesIsRefused) {
  for (const char* end : {"86401", "1e12", "1e17", "1e300"}) {
    const std::string path = waypoint_file("0 0 0 0\n1 0.1 0 0\n2 8 0 0\n" + std::string(end) + " 8 0 0\n");
    EXPECT_NE(refusal(path, {}).find(":4: time exceeds 86400 s"), std::string::npos) << end;
  }
}

TEST(WaypointPath, LinesThatSayNothingAreCountedAndADayIsNotTooLong) {
  const std::string text = "# a path\r\n\n \t\r\n0 0 0 0 # start\r\n86400 1 0 0\n86400 1 0 0\n";
  EXPECT_NE(refusal(waypoint_file(text), kAnything).find(":6: times must increase"), std::string::npos);
}

/// 3 t^2 - 2 t^3: 1.5 m/s in its middle, and 5.97 m/s^2 over its first tick.
TEST(WaypointPath, WhatTheRobotJustDoesIsAllowed) {
  const std::string fast = waypoint_file("0 0 0 0\n1 1 0 0\n");
  EXPECT_EQ(refusal(fast, {1.50001, 5.9701, 10.0}), "");
  EXPECT_NE(refusal(fast, {1.4999, 5.9701, 10.0}).find("asks for 1.5 m/s at"), std::string::npos);
  EXPECT_NE(refusal(fast, {1.50001, 5.9699, 10.0}).find("asks for 5.97 m/s^2 at 0.005 s"), std::string::npos);
  const std::string told = refusal(fast, {1.23456, 5.9701, 10.0});
  EXPECT_EQ(told.substr(told.find(';')), "; the robot does 1.23") << "three digits";
  EXPECT_EQ(refusal("waltz", {2.0, 7.0, kPi}), "") << "half a turn per second";
  EXPECT_NE(refusal("waltz", {2.0, 7.0, 3.14}).find("rad/s of yaw"), std::string::npos);
  PathLimits nose{2.0, 7.0, 0.33};
  nose.along_nose = true;
  EXPECT_NE(refusal("circle", nose).find("rad/s of yaw"), std::string::npos) << "0.1 m/s over 0.3 m";
  nose.yaw_rate_rad_s = 0.334;
  EXPECT_EQ(refusal("circle", nose), "");
}

TEST(WaypointPath, AJumpBetweenTwoTicksIsRefused) {
  const std::string jump = waypoint_file("0 0 0 0\n4.0001 0 0 0\n4.0002 3 0 0\n8 3 0 0\n");
  EXPECT_NE(refusal(jump, kAnything), "");
  std::string unseen = "0 0 0 0\n";  // at rest again by the next tick
  for (int i = 0; i < 30; ++i)
    unseen += std::to_string(4.0005 + 1e-4 * i) + (i < 15 ? " 0 0 0\n" : " 3 0 0\n");
  EXPECT_NE(
      refusal(waypoint_file(unseen + "8 3 0 0\n"), kAnything).find("asks for 600 m/s between two ticks"),
      std::string::npos);
}

TEST(WaypointPath, ARobotThatGoesAlongItsNoseRefusesCusps) {
  PathLimits nose = kAnything;
  nose.along_nose = true;
  // Out and back: half a turn within a tick, at 4 s on a tick and at 4.0025 s between two.
  for (const char* back : {"0 0 0 0\n4 0.4 0 0\n8 0 0 0\n", "0 0 0 0\n4.0025 0.4 0 0\n8.005 0 0 0\n"}) {
    EXPECT_EQ(refusal(waypoint_file(back), kAnything), "") << "a ball goes back";
    EXPECT_NE(refusal(waypoint_file(back), nose).find("asks for"), std::string::npos);
  }
  EXPECT_EQ(refusal(waypoint_file("0 0 0 0\n4 -0.4 0 0\n"), nose), "") << "it begins along the path";
  for (const char* name : {"circle", "figure8", "square"}) EXPECT_EQ(refusal(name, nose), "");
}

/// A metre in 4 s, a stop without any acceleration, and a metre another way: the spline's own pieces.
TEST(WaypointPath, ARobotThatGoesAlongItsNoseTurnsUpTo45DegreesWhereItStops) {
  PathLimits nose = kAnything;
  nose.along_nose = true;
  const auto told = [&](double degrees) {
    const double x = std::cos(degrees * kPi / 180.0);
    const double y = std::sin(degrees * kPi / 180.0);
    std::string text = "0 0 0 0\n2 0.75 0 0\n4 1 0 0\n";
    for (const auto& [t, way] : {std::pair(6.0, 0.25), std::pair(8.0, 1.0)}) {
      char line[120];
      std::snprintf(line, sizeof line, "%g %.17g %.17g 0\n", t, 1.0 + way * x, way * y);
      text += line;
    }
    return refusal(waypoint_file(text), nose);
  };
  for (const double degrees : {44.0, -44.0}) EXPECT_EQ(told(degrees), "") << degrees;
  for (const double degrees : {46.0, -46.0, 170.0})
    EXPECT_NE(told(degrees).find("rad of turn on the spot at 4"), std::string::npos) << degrees;
}

TEST(WaypointPath, ItsLastTickIsCheckedToo) {
  const std::string brakes_late = waypoint_file("0 0 0 0\n4 0.5 0 0\n4.5 1 0 0\n");
  const double last = make_path(brakes_late, kSpeed_m_s, kAnything)->at(4.495).velocity_W_m_s.norm() / kTickS;
  EXPECT_EQ(refusal(brakes_late, {10.0, 1.0001 * last, 10.0}), "");
  EXPECT_NE(refusal(brakes_late, {10.0, 0.9999 * last, 10.0}).find("m/s^2 at 4.5 s"), std::string::npos);
}

}  // namespace
}  // namespace equipoise::app
