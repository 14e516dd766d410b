// What is held against a foreign table: each check on both sides of its limit, and orders of wheels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "app/import/checks.hpp"
#include "app/import/signals.hpp"
#include "app/import/table_checks.hpp"
#include "app/import/wheel_order.hpp"
#include "support/foreign_table.hpp"

namespace equipoise::app {
namespace {

using ::testing::HasSubstr;

Check check_of(const Foreign& f, const std::string& name) {
  for (const Check& c : check_import(f.table, imported_rows(f.table, f.map, f.robot), f.map, f.robot))
    if (c.name == name) return c;
  return {};
}

TEST(ImportChecks, NameGapsRepeatsJumpsClippingAndUnits) {
  Foreign f;
  EXPECT_EQ(check_of(f, "gaps").ok, true);
  EXPECT_EQ(check_of(f, "repeats").ok, true);
  EXPECT_EQ(check_of(f, "wheel_jumps").ok, true);
  EXPECT_EQ(check_of(f, "accel_norm").ok, true);
  Foreign bad;
  for (auto& column : bad.table.columns) column.erase(column.begin() + 40, column.begin() + 55);
  EXPECT_EQ(check_of(bad, "gaps").ok, false);
  for (std::size_t k = 60; k < 70; ++k) bad.table.columns[1][k] = bad.table.columns[1][60];
  EXPECT_EQ(check_of(bad, "repeats").ok, false);
  bad.table.columns[4][30] += 1.0;
  EXPECT_EQ(check_of(bad, "wheel_jumps").ok, false);
  bad.map.gyro.range = 0.5;
  EXPECT_EQ(check_of(bad, "gyro_clipping").ok, false);
  for (double& up : bad.table.columns[3]) up /= 9.8;
  EXPECT_THAT(check_of(bad, "accel_norm").text, HasSubstr("accel.unit is g, not m/s2"));
  for (double& t : bad.table.columns[0]) t *= 1e3;
  EXPECT_THAT(check_of(bad, "clock").text, HasSubstr("ms or us"));
  bad.table.columns[0][20] = bad.table.columns[0][10];
  EXPECT_THAT(check_of(bad, "clock").text, HasSubstr("does not advance"));
}

/// Before and after the stretches that balance the robot may lie on its head.
TEST(ImportChecks, OnlyWhatBalancesIsHeldAgainstAMap) {
  Foreign f;
  for (auto& column : f.table.columns) {
    std::vector<double> longer;
    for (int i = 0; i < 30; ++i) longer.insert(longer.end(), column.begin(), column.end());
    column = longer;
  }
  for (std::size_t k = 0; k < 3000; ++k) {
    f.table.columns[0][k] = 1e-3 * static_cast<double>(k);
    f.table.columns[4][k] = 1e-3 * static_cast<double>(k);
    f.table.columns[3][k] = k >= 1100 && k < 1900 ? 9.8 : -9.8;
  }
  f.map.balancing = {{0.89, 1.9}};  // 0.2 s of it are for the start
  EXPECT_EQ(check_of(f, "accel_up").ok, true);
  f.map.balancing = {{1.2, 2.9}};
  EXPECT_EQ(check_of(f, "accel_up").ok, false);
  EXPECT_THAT(check_of(f, "accel_up").text, HasSubstr("accel z is flipped"));
  f.map.balancing.clear();
  EXPECT_EQ(check_of(f, "accel_up").ok, false) << "all of the table";
}

/// Of a table by itself, after a change of its rows.
Check table_check(const std::string& name, const std::function<void(Foreign&, ImportedRows&)>& change) {
  Foreign f;
  ImportedRows rows = imported_rows(f.table, f.map, f.robot);
  change(f, rows);
  for (const Check& c : check_table(f.table, rows, f.map, f.robot))
    if (c.name == name) return c;
  return {};
}

TEST(TableChecks, EachHasALimit) {
  const double count = 2.0 * kPi / 2134.62;
  const double fastest = 1.5 * Foreign().robot.motor.no_load_rad_s(7.4);
  const auto torn = [](std::size_t n) { return [n](Foreign& f, auto&) { f.table.torn_rows = n; }; };
  const auto rate = [](double step_s) {
    return [step_s](auto&, ImportedRows& r) {
      for (std::size_t k = 0; k < r.t_s.size(); ++k) r.t_s[k] = step_s * static_cast<double>(k);
    };
  };
  const auto late = [](double s) {
    return [s](auto&, ImportedRows& r) {
      for (std::size_t k = 50; k < r.t_s.size(); ++k) r.t_s[k] += s;
    };
  };
  const auto repeats = [](std::size_t n) {
    return [n](auto&, ImportedRows& r) {
      for (std::size_t k = 1; k <= n; ++k) r.gyro_rad_s[k] = r.gyro_rad_s[0];
    };
  };
  const auto jump = [](double rad) {
    return [rad](auto&, ImportedRows& r) {
      for (std::size_t k = 50; k < r.t_s.size(); ++k) r.wheel_rad[k][1] = r.wheel_rad[49][1] - rad;
    };
  };
  const auto range = [](double rad_s) { return [rad_s](Foreign& f, auto&) { f.map.gyro.range = rad_s; }; };
  const auto plateau = [](std::size_t n) {
    return [n](auto&, ImportedRows& r) {
      for (std::size_t k = 0; k < n; ++k) r.gyro_rad_s[k].y() = -2.0;
    };
  };
  const auto norm = [](double factor) {
    return [factor](auto&, ImportedRows& r) {
      for (Vec3& a : r.accel_m_s2) a *= factor;
    };
  };
  const struct {
    const char* name;
    bool ok;
    std::function<void(Foreign&, ImportedRows&)> change;
    const char* text;
  } rows[] = {
      {"rows", true, torn(1), "100 rows; 1 with another number"},
      {"rows", false, torn(2), "2 with another"},
      {"clock", true, rate(0.01), "100.0 rows a second, longest step 10.0 ms"},
      {"clock", false, rate(0.0103),
       "97.1 rows a second, longest step 10.3 ms; at least 100 are needed. Is time.unit ms or us?"},
      {"clock", true, rate(1.1e-5), "rows a second"},
      {"clock", false, rate(0.9e-5), "too fast for a control loop: is time.unit s or ms?"},
      {"clock", false, [](auto&, ImportedRows& r) { r.not_advancing = 3; },
       "3 rows whose time does not advance"},
      {"gaps", true, late(3.9e-3), "0 gaps"},  // with the row's own: below a tick
      {"gaps", false, late(4.1e-3), "1 gaps of more than two rows"},
      {"gaps", true, [&](auto& f, auto& r) { rate(0.01)(f, r), late(0.014)(f, r); }, "0 gaps"},
      {"gaps", false, [&](auto& f, auto& r) { rate(0.01)(f, r), late(0.016)(f, r); }, "1 gaps"},
      {"repeats", true, repeats(0), "0.0 %"},
      {"repeats", false, repeats(1), "1.0 % of the IMU's samples repeat"},
      {"repeats", true,
       [](auto&, ImportedRows& r) {
         r.gyro_rad_s[1] = r.gyro_rad_s[0];
         r.accel_m_s2[1].z() += 0.1;
       },
       "0.0 %"},
      {"wheel_jumps", true, jump(fastest * 1e-3 + 1.99 * count), "0 steps"},
      {"wheel_jumps", false, jump(fastest * 1e-3 + 2.01 * count),
       "1 steps beyond 1.5 times the no-load speed of"},
      {"wheel_jumps", false,
       [](auto&, ImportedRows& r) {
         for (std::size_t k = 0; k < r.t_s.size(); ++k) r.wheel_rad[k][0] = k % 9 == 0 ? 9.0 : 0.0;
       },
       "is wheels.unit right?"},
      {"wheel_jumps", false, jump(47.6), ", the largest 47.6 rad at 0.05"},
      {"gyro_clipping", true, range(1.0), "0.00 %"},
      {"gyro_clipping", false, range(0.985), "1.00 % of the samples"},
      {"gyro_clipping", true, plateau(4), "0.00 %"},
      {"gyro_clipping", false, plateau(5), "5.00 %"},
      {"accel_clipping", false, [](Foreign& f, auto&) { f.map.accel.range = 9.8; }, "100.00 %"},
      {"accel_norm", true, norm(1.39 * kGravity_m_s2 / 9.8), "median 1.390 g"},
      {"accel_norm", false, norm(1.41 * kGravity_m_s2 / 9.8), "accel.scale or a channel is wrong"},
      {"accel_norm", true, norm(0.72 * kGravity_m_s2 / 9.8), "median 0.720 g"},
      {"accel_norm", false, norm(0.71 * kGravity_m_s2 / 9.8), "accel.scale or a channel is wrong"},
      {"accel_norm", false, norm(9.8), "accel.unit is m/s2, not g"},
      {"accel_norm", false, norm(1e-3), "accel.unit is mg, not g"},
      {"accel_norm", false, norm(1e3), "accel.unit is g, not mg"},
  };
  for (std::size_t i = 0; i < std::size(rows); ++i) {
    const Check c = table_check(rows[i].name, rows[i].change);
    EXPECT_EQ(c.ok, rows[i].ok) << i << " " << c.name << ": " << c.text;
    EXPECT_THAT(c.text, HasSubstr(rows[i].text)) << i;
  }
}

TEST(TableChecks, AFactorNearAMistakeOfUnitsIsThatMistake) {
  const std::vector<std::pair<double, const char*>> known{{10.0, "ten"}, {0.1, "a tenth"}};
  for (const double off : {1.0, std::exp(0.19), std::exp(-0.19)}) {
    EXPECT_EQ(units_mistake(10.0 * off, 10.0 * off, known), "ten");
    EXPECT_EQ(units_mistake(0.1 * off, 0.1 * off, known), "a tenth");
  }
  for (const double off : {std::exp(0.21), std::exp(-0.21)})
    EXPECT_EQ(units_mistake(10.0 * off, 10.0 * off, known), "");
  EXPECT_EQ(units_mistake(3.0, 20.0, known), "ten")
      << "what a fit says and its reverse are to each side of it";
  EXPECT_EQ(median({3.0, 9.0, 1.0}), 3.0);
}

TEST(WheelOrder, NamesTheSimplestMistake) {
  const double d = kPi / 180.0;
  const auto axes = [](double first_rad) {
    Mat3 m;
    for (int i = 0; i < 3; ++i) {
      const double at = first_rad + 2.0 * kPi / 3.0 * i;
      m.col(i) = Vec3(std::cos(at), std::sin(at), 0.5);
    }
    return m;
  };
  const Mat3 configured = axes(0.3);
  const struct {
    std::array<int, 3> at, sign;
    double azimuth_deg;
    const char* text;
  } rows[] = {
      {{0, 1, 2}, {1, 1, 1}, 0.0, ""},
      {{0, 1, 2}, {1, 1, 1}, 19.5, ""},
      {{0, 1, 2}, {1, 1, 1}, 20.5, ": robot.wheel_azimuth_deg is off: add 20"},
      {{0, 1, 2}, {1, 1, 1}, -40.0, ": robot.wheel_azimuth_deg is off: add -40"},
      {{0, 1, 2}, {-1, 1, 1}, 0.0, ": the sign of column 1 is flipped"},
      {{0, 1, 2}, {1, -1, -1}, 5.0, ": the sign of column 2 is flipped; the sign of column 3 is flipped"},
      {{0, 2, 1}, {1, 1, 1}, 0.0, ": the wheels' columns are wheels 1, 3, 2 of the configuration"},
      {{2, 1, 0},
       {1, 1, -1},
       0.0,
       ": the wheels' columns are wheels 3, 2, 1 of the configuration; the sign of column 3 is flipped"},
      {{1, 2, 0},
       {1, 1, 1},
       0.0,
       ": the wheels' columns are wheels 2, 3, 1 of the configuration, or robot.wheel_azimuth_deg is 120 "
       "degrees off"},
      {{1, 0, 2},
       {1, 1, 1},
       30.0,
       ": the wheels' columns are wheels 2, 1, 3 of the configuration; robot.wheel_azimuth_deg is off: add "
       "30"},
  };
  for (const auto& row : rows) {
    Mat3 measured;
    for (int i = 0; i < 3; ++i) {
      const auto k = static_cast<std::size_t>(i);
      measured.col(i) = row.sign[k] *
                        Eigen::AngleAxisd(row.azimuth_deg * d, Vec3::UnitZ()).toRotationMatrix() *
                        configured.col(row.at[k]);
    }
    const WheelOrder order = wheel_order(configured, 0.7 * measured);
    EXPECT_EQ(order.mistake, row.text);
    EXPECT_EQ(order.at, row.at) << row.text;
    EXPECT_EQ(order.sign, row.sign) << row.text;
    EXPECT_NEAR(order.azimuth_rad, row.azimuth_deg * d, 1e-9) << row.text;
  }
  Mat3 turned = configured;  // with the gyro's z the ball turns the other way, and so do all
  turned.row(2) *= -1.0;
  EXPECT_EQ(wheel_order(configured, turned).mistake, ": gyro z is flipped");
}

Series series(const std::vector<double>& values) {
  return Eigen::Map<const Series>(values.data(), static_cast<Eigen::Index>(values.size()));
}

TEST(Signals, FiltersSumsAndSlopesAreWhatTheySay) {
  EXPECT_TRUE(
      (derivative(series({0.0, 1.0, 2.0, 4.0, 4.0})) == series({0.0, 200.0, 300.0, 200.0, 0.0})).all());
  EXPECT_TRUE((integral(series({1.0, 1.0, 3.0})) == series({0.0, 0.005, 0.015})).all());
  Series step = Series::Ones(100);
  step(0) = 0.0;
  EXPECT_NEAR(smooth(step, 2.0)(40), 1.0 - std::exp(-2.0 * kPi * 2.0 * 40 * kTickS), 1e-12);
  for (const auto& [hz, most, least] :
       {std::tuple{0.02, 0.05, 0.0}, std::tuple{2.0, 1.0, 0.5}, std::tuple{50.0, 0.02, 0.0}}) {
    const Series wave = (2.0 * kPi * hz * kTickS * Series::LinSpaced(8000, 0.0, 7999.0)).sin();
    const double gain = std::sqrt(2.0 * balancing(wave).tail(6000).square().mean());
    EXPECT_LE(gain, most) << hz;
    EXPECT_GE(gain, least) << hz;
  }
}

}  // namespace
}  // namespace equipoise::app
