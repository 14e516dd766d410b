#include "app/import/import.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

#include "app/text/errors.hpp"
#include "equipoise/actuate/safety.hpp"
#include "support/foreign_table.hpp"
#include "support/own_file.hpp"

namespace equipoise::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::string table_refusal(const std::string& path, const TableShape& shape = {}) {
  try {
    const Table table = read_table(path, shape);
    for (const std::string& name : table.names) table.column(name);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Table, ReadsCsvWithNamesBlanksAndEmptyCells) {
  const Table t = read_table(own_file("a.csv", "t, \"u\",w\n0.0,1e-3,\n0.5,-2,+3\r\n"), {});
  EXPECT_THAT(t.names, ElementsAre("t", "u", "w"));
  EXPECT_THAT(t.columns[1], ElementsAre(1e-3, -2.0));
  EXPECT_TRUE(std::isnan(t.columns[2][0]));
  EXPECT_EQ(t.columns[2][1], 3.0);
}

TEST(Table, ReadsColumnsByBlanksAfterCommentsAndCountsTornRows) {
  const Table t = read_table(own_file("b.txt", "% head\n%% more\n 1  2\n3 4 \n5\n6 7\n"), {{"a", "b"}});
  EXPECT_THAT(t.columns[1], ElementsAre(2.0, 4.0, 7.0));
  EXPECT_EQ(t.torn_rows, 1U);
}

TEST(Table, ReadsFloat32RowsBehindAHeader) {
  const float values[5] = {1.5F, -2.0F, 3.25F, 4.0F, 9.0F};  // the last row is torn
  std::string bytes(3, 'x');
  bytes.append(reinterpret_cast<const char*>(values), sizeof values);
  const Table t = read_table(own_file("c.bin", bytes), {{"a", "b"}, true, 3});
  EXPECT_THAT(t.columns[0], ElementsAre(1.5, 3.25));
  EXPECT_THAT(t.columns[1], ElementsAre(-2.0, 4.0));
  EXPECT_EQ(t.torn_rows, 1U);
}

TEST(Table, TakesWhatSpreadsheetsWriteAroundATable) {
  const Table t = read_table(own_file("s.csv", "\xEF\xBB\xBF\"\"\n\"t\",\"u\"\n\"\"\n1,2\n\"\n"), {});
  EXPECT_THAT(t.names, ElementsAre("t", "u"));
  EXPECT_THAT(t.columns[1], ElementsAre(2.0));
  EXPECT_THAT(read_table(own_file("k.csv", "t;u\n0,5;-1,25\n"), {}).columns[1], ElementsAre(-1.25));
}

TEST(Table, TakesTextInAColumnThatNobodyAsksFor) {
  const Table t = read_table(own_file("i.txt", "now 1 0x0\nlater 2 0x0\n"), {{"day", "u", "flags"}});
  EXPECT_THAT(t.column("u"), ElementsAre(1.0, 2.0));
  EXPECT_EQ(read_table(own_file("j.csv", "a,b\n1,2,late\n3,4,\n"), {}).torn_rows, 1U) << "a cell too many";
  EXPECT_THAT([&] { t.column("flags"); }, ThrowsMessage<InputError>(HasSubstr("i.txt:1: flags: \"0x0\"")));
}

TEST(Table, NamesWhatItCannotRead) {
  EXPECT_THAT(table_refusal(own_file("d.csv", "a,b\n1,2\n3,four\n")),
              HasSubstr("d.csv:3: b: \"four\" is not a number"));
  EXPECT_THAT(table_refusal(own_file("e.csv", "1,2\n3,4\n")), HasSubstr("table.columns"));
  EXPECT_THAT(table_refusal(own_file("f.txt", "1 2\n3 4\n"), {{"a", "b", "c"}}), HasSubstr("2 cells"));
  EXPECT_THAT(table_refusal(own_file("g.mat", "MATLAB 5.0")), HasSubstr("./tools/table"));
  EXPECT_THAT(table_refusal(own_file("h.bin", std::string("\0\0\0\0", 4))), HasSubstr("float32"));
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
  return read_import_map(own_file("map.toml", text));
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

TEST(Import, TimeIsAColumnStepsOrARate) {
  const auto times = [](const std::function<void(Foreign&)>& change) {
    Foreign f;
    change(f);
    return imported_rows(f.table, f.map, f.robot);
  };
  const ImportedRows column = times([](Foreign& f) { f.map.from_s = 0.01, f.map.to_s = 0.02; });
  EXPECT_EQ(column.t_s.size(), 11U) << "both ends are in it";
  EXPECT_DOUBLE_EQ(column.t_s.front(), 0.01);
  EXPECT_DOUBLE_EQ(column.gyro_rad_s.front().x(), 0.1) << "the row's own values";
  const ImportedRows steps = times([](Foreign& f) {
    f.map.time_is_step = true;
    for (double& t : f.table.columns[0]) t = 0.002;
  });
  EXPECT_EQ(steps.t_s.front(), 0.0);
  EXPECT_NEAR(steps.t_s.back(), 99 * 0.002, 1e-12);
  const ImportedRows rate = times([](Foreign& f) { f.map.time.name.clear(), f.map.rate_hz = 50.0; });
  EXPECT_DOUBLE_EQ(rate.t_s[3], 0.06);
  const ImportedRows back = times([](Foreign& f) { f.table.columns[0][7] = f.table.columns[0][6]; });
  EXPECT_EQ(back.not_advancing, 1U);
  EXPECT_EQ(back.t_s.size(), 99U);
  EXPECT_DOUBLE_EQ(back.t_s[7], 0.008);
}

TEST(Import, RefusesWhatTheTableOrTheRobotHasNot) {
  const auto why = [](const std::function<void(Foreign&)>& change) -> std::string {
    Foreign f;
    change(f);
    try {
      (void)imported_rows(f.table, f.map, f.robot);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(why([](Foreign& f) { f.map.gyro.axes[1].name = "q"; }),
              HasSubstr("no column \"q\", which the map names; it has t, g, zero, up, w, v"));
  EXPECT_THAT(why([](Foreign& f) { f.map.wheels.axes.pop_back(); }),
              HasSubstr("wheels.axes of the map names 1 columns"));
  EXPECT_THAT(why([](Foreign& f) { f.map.drive.axes.push_back({"v", 1.0}); }), HasSubstr("has 2 wheels"));
  EXPECT_THAT(why([](Foreign& f) {
                f.map.tilt.axes = {{"g", 1.0}, {"g", 1.0}};
              }),
              HasSubstr("balances about 1"));
  EXPECT_EQ(why([](Foreign& f) { f.map.tilt.axes = {{"g", 1.0}}; }), "");
  EXPECT_THAT(why([](Foreign& f) { f.map.from_s = f.map.to_s = 0.05; }), HasSubstr("fewer than two rows"));
  EXPECT_EQ(why([](Foreign& f) { f.map.from_s = 0.0495, f.map.to_s = 0.0515; }), "");
  EXPECT_EQ(why([](Foreign& f) { f.table.columns[0].back() = 7200.0; }), "");
  EXPECT_THAT(why([](Foreign& f) { f.table.columns[0].back() = 7200.1; }),
              HasSubstr("two hours are the most"));
  EXPECT_THAT(why([](Foreign& f) {
                for (auto& c : f.table.columns) c.clear();
              }),
              HasSubstr("no row of numbers"));
}

TEST(Import, ADriveIsAShareOfTheNominalVoltage) {
  Foreign f;
  f.map.battery = {"up", 1.0};  // 9.8 V
  f.map.drive.kind = "duty";
  f.map.drive.axes[0].factor = 0.1;
  const double nominal_V = f.robot.motor.nominal_V;
  const ImportedRows duty = imported_rows(f.table, f.map, f.robot);
  EXPECT_NEAR(duty.drive[50][0], 0.6 * 9.8 / nominal_V, 1e-12);
  EXPECT_EQ(duty.drive[19][0], 0.0);
  EXPECT_EQ(duty.battery_V[50], 9.8);
  f.map.drive.kind = "volts";
  EXPECT_NEAR(imported_rows(f.table, f.map, f.robot).drive[50][0], 0.6 / nominal_V, 1e-12);
  f.map.drive.kind = "torque";
  const MotorParameters& m = f.robot.motor;
  EXPECT_NEAR(imported_rows(f.table, f.map, f.robot).drive[50][0], (0.6 + m.k2()) / m.k1(), 1e-6);
}

TEST(Import, RatesAreSummedAndValuesRoundedToTheirQuantum) {
  Foreign f;
  f.map.wheels.kind = "rate";
  f.map.wheels.axes = {{"v", 1.0}, {"up", 1.0}};
  f.map.gyro.quantum = 0.04;
  f.table.columns[5][30] = NAN;  // is not summed
  const ImportedRows rows = imported_rows(f.table, f.map, f.robot);
  EXPECT_EQ(rows.wheel_rad[19][0], 0.0);
  EXPECT_NEAR(rows.wheel_rad[29][0], 6.0 * 0.010, 1e-12);
  EXPECT_NEAR(rows.wheel_rad[31][0], 6.0 * 0.011, 1e-12);
  EXPECT_NEAR(rows.wheel_rad[1][1], 9.8e-3, 1e-12);
  EXPECT_NEAR(rows.gyro_rad_s[5].x(), 0.04, 1e-12);
  EXPECT_NEAR(rows.gyro_rad_s[7].x(), 0.08, 1e-12);
}

TEST(Import, TicksAreThoseOfARunThatSomebodyElseDrove) {
  Foreign f;
  f.map.balancing = {{0.02, 0.03}, {0.05, 0.05}};
  f.map.tilt.axes = {{"g", 2.0}};
  const auto ticks = f.ticks();
  for (const auto& t : ticks) {
    const bool on = (t.tick >= 4 && t.tick <= 6) || t.tick == 10;
    EXPECT_EQ(t.arm, on) << t.tick;
    EXPECT_EQ(t.motors.enable, on) << t.tick;
    EXPECT_EQ(t.arm_state, static_cast<std::int32_t>(on ? ArmState::kArmed : ArmState::kDisarmed)) << t.tick;
    EXPECT_NEAR(t.estimate.theta_rad[0], 0.02 * 5.0 * static_cast<double>(t.tick), 1e-12);
    EXPECT_EQ(t.battery_V, 7.4);
    EXPECT_EQ(t.motor_count, 2);
    EXPECT_EQ(t.u_lin, t.u_friction);
  }
  const double sign = f.robot.calibration.motor_sign[0];
  EXPECT_NEAR(ticks[5].motors.duty[0], sign * 6.0 / 7.4, 1e-12);
  EXPECT_EQ(ticks[5].motors.duty[1], 0.0);
  const Calibration& c = f.robot.calibration;
  EXPECT_NEAR(ticks[5].raw.battery_counts, (7.4 - c.battery_offset_V) / c.battery_V_per_count, 1e-9);
  f.map.battery_V = NAN;
  f.table.columns[4][10] = NAN;
  EXPECT_EQ(f.ticks()[2].raw.valid, static_cast<unsigned>(RIO_IMU));
  f.table.columns[1][10] = NAN;
  EXPECT_EQ(f.ticks()[2].raw.valid, 0U);
}

TEST(Import, OfABenchIsOneMotor) {
  Foreign f;
  f.map.current.axes = {{"g", 1.0}, {"up", -1.0}};
  const auto samples = imported_bench(f.table, f.map, 1);
  ASSERT_EQ(samples.size(), 100U);
  EXPECT_DOUBLE_EQ(samples[50].t_s, 0.05);
  EXPECT_EQ(samples[50].u, 0.0);
  EXPECT_EQ(samples[50].current_A, -9.8);
  EXPECT_EQ(samples[50].angle_rad, 0.05);
  EXPECT_NEAR(imported_bench(f.table, f.map, 0)[50].u, 6.0 / 7.4, 1e-12);
  f.map.battery = {"up", 1.0};
  f.map.drive.kind = "duty";
  EXPECT_NEAR(imported_bench(f.table, f.map, 0)[50].u, 6.0, 1e-12);
  EXPECT_EQ(imported_bench(f.table, f.map, 0)[50].supply_V, 9.8);
  f.map.wheels.kind = "rate";
  EXPECT_NEAR(imported_bench(f.table, f.map, 0)[2].angle_rad, 3e-6, 1e-12);
  const auto why = [&f](std::size_t motor) -> std::string {
    try {
      (void)imported_bench(f.table, f.map, motor);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(why(2), HasSubstr("there is no motor 3"));
  f.map.current.axes.pop_back();
  EXPECT_THAT(why(1), HasSubstr("current.axes of the map names 1 columns"));
  f.map.drive.kind = "torque";
  EXPECT_THAT(why(0), HasSubstr("volts or duty"));
}

}  // namespace
}  // namespace equipoise::app
