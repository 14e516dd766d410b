#include "app/import/import.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "app/import/checks.hpp"
#include "app/text/errors.hpp"

namespace equipoise::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string file_of(const std::string& name, const std::string& content) {
  const std::string path = ::testing::TempDir() + name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

std::string refusal(const std::string& path, const TableShape& shape = {}) {
  try {
    read_table(path, shape);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Table, ReadsCsvWithNamesBlanksAndEmptyCells) {
  const Table t = read_table(file_of("a.csv", "t, \"u\",w\n0.0,1e-3,\n0.5,-2,+3\r\n"), {});
  EXPECT_THAT(t.names, ElementsAre("t", "u", "w"));
  EXPECT_THAT(t.columns[1], ElementsAre(1e-3, -2.0));
  EXPECT_TRUE(std::isnan(t.columns[2][0]));
  EXPECT_EQ(t.columns[2][1], 3.0);
}

TEST(Table, ReadsColumnsByBlanksAfterCommentsAndCountsTornRows) {
  const Table t =
      read_table(file_of("b.txt", "% head\n%% more\n 1  2\n3 4 \n5\n6 7\n"), {{"a", "b"}, false, 0});
  EXPECT_THAT(t.columns[1], ElementsAre(2.0, 4.0, 7.0));
  EXPECT_EQ(t.torn_rows, 1U);
}

TEST(Table, ReadsFloat32RowsBehindAHeader) {
  const float values[5] = {1.5F, -2.0F, 3.25F, 4.0F, 9.0F};  // the last row is torn
  std::string bytes(3, 'x');
  bytes.append(reinterpret_cast<const char*>(values), sizeof values);
  const Table t = read_table(file_of("c.bin", bytes), {{"a", "b"}, true, 3});
  EXPECT_THAT(t.columns[0], ElementsAre(1.5, 3.25));
  EXPECT_THAT(t.columns[1], ElementsAre(-2.0, 4.0));
  EXPECT_EQ(t.torn_rows, 1U);
}

TEST(Table, TakesWhatSpreadsheetsWriteAroundATable) {
  const Table t = read_table(file_of("s.csv", "\xEF\xBB\xBF\"\"\n\"t\",\"u\"\n\"\"\n1,2\n\"\n"), {});
  EXPECT_THAT(t.names, ElementsAre("t", "u"));
  EXPECT_THAT(t.columns[1], ElementsAre(2.0));
}

TEST(Table, NamesWhatItCannotRead) {
  EXPECT_THAT(refusal(file_of("d.csv", "a,b\n1,2\n3,four\n")),
              HasSubstr("d.csv:3: b: \"four\" is not a number"));
  EXPECT_THAT(refusal(file_of("e.csv", "1,2\n3,4\n")), HasSubstr("table.columns"));
  EXPECT_THAT(refusal(file_of("f.txt", "1 2\n3 4\n"), {{"a", "b", "c"}, false, 0}), HasSubstr("2 cells"));
  EXPECT_THAT(refusal(file_of("g.mat", "MATLAB 5.0")), HasSubstr("./tools/table"));
  EXPECT_THAT(refusal(file_of("h.bin", std::string("\0\0\0\0", 4))), HasSubstr("float32"));
}

/// Parts of a map, of which a test replaces one.
ImportMap map_of(std::map<std::string, std::string> parts) {
  parts.insert({{"robot", "robot = \"robots/mine.toml\"\n"},
                {"time", "[time]\nrate_hz = 100\n"},
                {"wheels", "[wheels]\nkind = \"angle\"\naxes = [\"a\", \"-b\"]\nunit = \"rad\"\n"},
                {"drive", "[drive]\nkind = \"duty\"\naxes = [\"c\", \"d\"]\nunit = \"1\"\n"},
                {"battery", "[battery]\nvolts = 7.4\n"},
                {"gyro", "[gyro]\naxes = [\"x\", \"y\", \"z\"]\nunit = \"rad/s\"\n"},
                {"accel", "[accel]\naxes = [\"x\", \"y\", \"z\"]\nunit = \"m/s2\"\n"}});
  std::string text = parts["robot"];
  for (const auto& [name, part] : parts)
    if (name != "robot") text += part;
  return read_import_map(file_of("map.toml", text));
}
std::string map_refusal(const std::string& part, const std::string& text) {
  try {
    (void)map_of({{part, text}});
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(ImportMap, EveryUnitIsSoManyOfTheSI) {
  const double degree = kPi / 180.0;
  const struct {
    const char *kind, *unit;
    double factor;
  } wheels[] = {{"angle", "rad", 1.0},     {"angle", "deg", degree},   {"angle", "rev", 2.0 * kPi},
                {"rate", "rad/s", 1.0},    {"rate", "deg/s", degree},  {"rate", "rev/s", 2.0 * kPi},
                {"rate", "rpm", kPi / 30}, {"angle", nullptr, -0.125}, {"rate", nullptr, 4.0}},
    drive[] = {{"volts", "V", 1.0},    {"volts", "mV", 1e-3},    {"duty", "1", 1.0},      {"duty", "%", 0.01},
               {"torque", "N m", 1.0}, {"torque", "mN m", 1e-3}, {"torque", nullptr, 2.0}},
    gyro[] = {{"", "rad/s", 1.0}, {"", "deg/s", degree}, {"", "mdeg/s", 1e-3 * degree}},
    accel[] = {{"", "m/s2", 1.0}, {"", "g", kGravity_m_s2}, {"", "mg", 1e-3 * kGravity_m_s2}};
  const auto part = [](const char* name, const auto& row, const char* axes) {
    const std::string kind = *row.kind == 0 ? "" : "kind = \"" + std::string(row.kind) + "\"\n";
    const std::string unit = row.unit == nullptr ? "scale = " + std::to_string(row.factor)
                                                 : "unit = \"" + std::string(row.unit) + "\"";
    return "[" + std::string(name) + "]\n" + kind + "axes = " + axes + "\n" + unit +
           "\nquantum = 0.5\nrange = 100\ndelay_s = 0.25\nlow_pass_hz = 42\n";
  };
  const auto check = [](const Channel& c, const auto& row) {
    EXPECT_EQ(c.kind, row.kind);
    EXPECT_DOUBLE_EQ(c.axes[0].factor, row.factor) << row.unit;
    EXPECT_DOUBLE_EQ(c.axes[1].factor, -row.factor) << row.unit;
    EXPECT_EQ(c.axes[1].name, "b");
    EXPECT_DOUBLE_EQ(c.quantum, 0.5 * std::abs(row.factor)) << row.unit;
    EXPECT_DOUBLE_EQ(c.range, 100.0 * std::abs(row.factor)) << row.unit;
    EXPECT_EQ(c.delay_s, 0.25);
    EXPECT_EQ(c.low_pass_hz, 42.0);
  };
  const char* two = "[\"a\", \"-b\"]";
  const char* three = "[\"a\", \"-b\", \"c\"]";
  for (const auto& row : wheels) check(map_of({{"wheels", part("wheels", row, two)}}).wheels, row);
  for (const auto& row : drive) check(map_of({{"drive", part("drive", row, two)}}).drive, row);
  for (const auto& row : gyro) check(map_of({{"gyro", part("gyro", row, three)}}).gyro, row);
  for (const auto& row : accel) check(map_of({{"accel", part("accel", row, three)}}).accel, row);
  for (const auto& [unit, factor] :
       std::map<std::string, double>{{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}})
    EXPECT_EQ(map_of({{"time", "[time]\nstep = \"t\"\nunit = \"" + unit + "\"\n"}}).time.factor, factor);
  EXPECT_EQ(map_of({{"battery", "[battery]\ncolumn = \"v\"\nunit = \"mV\"\n"}}).battery.factor, 1e-3);
}

TEST(ImportMap, WhatIsNotSaidIsUnknownOrAll) {
  const ImportMap plain = map_of({});
  EXPECT_EQ(plain.robot,
            (std::filesystem::path(::testing::TempDir()) / "robots/mine.toml").lexically_normal().string());
  EXPECT_EQ(plain.rate_hz, 100.0);
  EXPECT_TRUE(plain.time.name.empty() && plain.balancing.empty() && plain.tilt.axes.empty() &&
              plain.source.empty());
  EXPECT_EQ(plain.from_s, 0.0);
  EXPECT_TRUE(std::isinf(plain.to_s));
  EXPECT_EQ(plain.gyro.quantum + plain.gyro.range + plain.gyro.delay_s + plain.gyro.low_pass_hz, 0.0);
  EXPECT_EQ(plain.battery_V, 7.4);
  EXPECT_FALSE(plain.table.float32);
  const ImportMap full =
      map_of({{"time", "[time]\ncolumn = \"t\"\nunit = \"ms\"\nfrom_s = 1\nto_s = 3\n"},
              {"source", "[source]\nsha256 = \"ab\"\n"},
              {"stretch", "[[balancing]]\nfrom_s = 1\nto_s = 2\n[[balancing]]\nfrom_s = 2\nto_s = 2\n"},
              {"table", "[table]\nformat = \"float32\"\nheader_bytes = 7\ncolumns = [\"t\", \"a\"]\n"},
              {"tilt", "[tilt]\ncolumn = \"-p\"\nunit = \"deg\"\n"}});
  EXPECT_EQ(full.time.name, "t");
  EXPECT_FALSE(full.time_is_step);
  EXPECT_EQ(full.from_s, 1.0);
  EXPECT_EQ(full.to_s, 3.0);
  EXPECT_EQ(full.source.at("sha256"), "ab");
  EXPECT_EQ(full.balancing.size(), 2U);
  EXPECT_EQ(full.balancing[1].from_s, 2.0);
  EXPECT_EQ(full.balancing[0].to_s, 2.0);
  EXPECT_TRUE(full.table.float32);
  EXPECT_EQ(full.table.header_bytes, 7U);
  EXPECT_EQ(full.table.columns.size(), 2U);
  EXPECT_EQ(full.tilt.axes[0].name, "p");
  EXPECT_DOUBLE_EQ(full.tilt.axes[0].factor, -kPi / 180.0);
  EXPECT_TRUE(map_of({{"time", "[time]\nstep = \"t\"\nscale = 2\n"}}).time_is_step);
}

TEST(ImportMap, RefusesWhatContradictsItself) {
  EXPECT_THAT(map_refusal("gyro", "[gyro]\naxes = [\"x\", \"y\"]\nunit = \"rad/s\"\n"),
              HasSubstr("three columns"));
  EXPECT_THAT(map_refusal("accel", "[accel]\naxes = [\"x\", \"y\", \"z\"]\nunit = \"g\"\nscale = 2\n"),
              HasSubstr("either unit or scale"));
  for (const char* time : {"[time]\n", "[time]\nrate_hz = 9\ncolumn = \"t\"\nunit = \"s\"\n",
                           "[time]\nstep = \"t\"\ncolumn = \"t\"\nunit = \"s\"\n"})
    EXPECT_THAT(map_refusal("time", time), HasSubstr("one of column, step, rate_hz"));
  EXPECT_THAT(map_refusal("time", "[time]\nrate_hz = 9\nfrom_s = 3\nto_s = 2\n"), HasSubstr("to_s"));
  EXPECT_THAT(map_refusal("stretch", "[[balancing]]\nfrom_s = 3\nto_s = 2\n"), HasSubstr("to_s"));
  EXPECT_THAT(map_refusal("wheels", "[wheels]\nkind = \"angle\"\naxes = [\"a\"]\nunit = \"rpm\"\n"),
              HasSubstr("rpm"));
  for (const char* name : {"time", "wheels", "drive", "battery", "gyro", "accel"}) {
    EXPECT_THAT(map_refusal(name, ""), HasSubstr(name)) << "is missing";
  }
  EXPECT_THAT(map_refusal("more", "[more]\nx = 1\n"), HasSubstr("more"));
}

// A table by hand: 1 kHz, the gyro counts up, both wheels turn at 1 rad/s, 6 V on the first wheel from 20 ms
// on.
struct Foreign {
  ImportedRobot robot = imported_robot(std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml");
  ImportMap map;
  Table table;

  Foreign() {
    robot.calibration.R_BS.setIdentity();
    table.names = {"t", "g", "zero", "up", "w", "v"};
    table.columns.resize(6);
    for (int k = 0; k < 100; ++k) {
      const double row[6] = {1e-3 * k, 0.01 * k, 0.0, 9.8, 1e-3 * k, k >= 20 ? 6.0 : 0.0};
      for (std::size_t i = 0; i < 6; ++i) table.columns[i].push_back(row[i]);
    }
    map.time = {"t", 1.0};
    map.gyro.axes = {{"g", 1.0}, {"zero", 1.0}, {"zero", 1.0}};
    map.accel.axes = {{"zero", 1.0}, {"zero", 1.0}, {"up", 1.0}};
    map.wheels.axes = {{"w", 1.0}, {"w", 1.0}};
    map.wheels.kind = "angle";
    map.drive.axes = {{"v", 1.0}, {"zero", 1.0}};
    map.drive.kind = "volts";
    map.battery_V = 7.4;
  }
  std::vector<runtime::TickRecord> ticks() const {
    return imported_ticks(imported_rows(table, map, robot), map, robot);
  }
};

TEST(Import, GivesEachTickTheNewestSampleInTheRobotsCounts) {
  const Foreign f;
  const auto ticks = f.ticks();
  ASSERT_EQ(ticks.size(), 20U);
  const auto z = calibrate<2>(ticks[3].raw, f.robot.calibration);
  EXPECT_EQ(ticks[3].now_ns, 15'000'000);
  EXPECT_EQ(ticks[3].raw.t_ns, 15'000'000);
  EXPECT_NEAR(z.gyro_B_rad_s.x(), 0.15, 0.5 * kPi / 180.0 / 16.4);  // half a count
  EXPECT_NEAR(z.accel_B_m_s2.z(), -9.8, 0.01);
  EXPECT_NEAR(z.wheel_angle_rad(1), 0.015, 0.5 * 2.0 * kPi / 2134.62);
  EXPECT_TRUE(z.imu_ok && z.encoders_ok && z.battery_ok);
}

TEST(Import, MeansTheDriveOverTheTickThatFollows) {
  Foreign f;
  f.map.drive.delay_s = 0.002;  // acts from 22 ms on
  const auto ticks = f.ticks();
  EXPECT_DOUBLE_EQ(ticks[3].u_friction[0], 0.0);
  EXPECT_NEAR(ticks[4].u_friction[0], 0.5 * (6.0 / 7.4) * 3.0 / 5.0, 1e-9);  // mean of the wheels, 3 ms of 5
  EXPECT_NEAR(ticks[5].u_friction[0], 0.5 * 6.0 / 7.4, 1e-9);
  EXPECT_NEAR(ticks[5].u_friction[1], 0.5 * 6.0 / 7.4, 1e-9);
}

TEST(Import, SaysWhereASlowLogHasNothingNew) {
  Foreign f;
  f.map.gyro.delay_s = 0.001;
  for (auto& column : f.table.columns) {
    std::vector<double> slow;
    for (std::size_t k = 0; k < column.size(); k += 12) slow.push_back(column[k]);
    column = slow;
  }
  const auto ticks = f.ticks();  // samples at 0, 12, 24, ... ms
  EXPECT_EQ(ticks[3].raw.valid & RIO_IMU, static_cast<unsigned>(RIO_IMU));
  EXPECT_EQ(ticks[3].raw.t_ns, 11'000'000);
  EXPECT_EQ(ticks[4].raw.valid, 0U);
}

TEST(Import, TakesAFirstOrderFilterBack) {
  Foreign f;
  f.map.gyro.low_pass_hz = 60.0;
  std::vector<double>& g = f.table.columns[1];
  const std::vector<double> true_rate = g;
  const double keep = std::exp(-2.0 * kPi * 60.0 * 1e-3);
  for (std::size_t k = 1; k < g.size(); ++k) g[k] = keep * g[k - 1] + (1.0 - keep) * true_rate[k];
  const ImportedRows rows = imported_rows(f.table, f.map, f.robot);
  for (std::size_t k = 0; k < g.size(); ++k) EXPECT_NEAR(rows.gyro_rad_s[k].x(), true_rate[k], 1e-9);
}

TEST(Import, TorqueIsTheVoltageThatMakesItAtThisSpeed) {
  Foreign f;
  f.map.drive.kind = "torque";
  f.map.drive.axes = {{"zero", 1.0}, {"zero", 1.0}};
  const ImportedRows rows = imported_rows(f.table, f.map, f.robot);
  EXPECT_NEAR(rows.drive[50][0], f.robot.motor.k2() * 1.0 / f.robot.motor.k1(),
              1e-9);  // against the back-EMF
}

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

}  // namespace
}  // namespace equipoise::app
