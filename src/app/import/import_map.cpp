#include "app/import/import_map.hpp"

#include <filesystem>

#include "config/toml_reader.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {
namespace {

using config::Document;
using config::number_or;
using config::Section;
using Units = std::map<std::string, double>;

constexpr double kDegree = kPi / 180.0;
const Units kTime{{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};
const Units kRate{{"rad/s", 1.0}, {"deg/s", kDegree}, {"mdeg/s", 1e-3 * kDegree}};
const Units kAcceleration{{"m/s2", 1.0}, {"g", kGravity_m_s2}, {"mg", 1e-3 * kGravity_m_s2}};
const Units kAngle{{"rad", 1.0}, {"deg", kDegree}, {"rev", 2.0 * kPi}};
const Units kWheelRate{{"rad/s", 1.0}, {"deg/s", kDegree}, {"rev/s", 2.0 * kPi}, {"rpm", 2.0 * kPi / 60.0}};
const Units kVolts{{"V", 1.0}, {"mV", 1e-3}};
const Units kDuty{{"1", 1.0}, {"%", 0.01}};
const Units kTorque{{"N m", 1.0}, {"mN m", 1e-3}};

/// `unit`, or `scale`: SI per number of the table.
double read_scale(Section& s, const Units& units) {
  if (s.has("scale") && s.has("unit")) s.fail("scale", "either unit or scale");
  if (s.has("scale")) return s.number("scale", -1e9, 1e9);
  std::vector<std::string> names;
  for (const auto& [name, factor] : units) names.push_back(name);
  return units.at(names[s.choice("unit", names)]);
}

/// "-gy": that column with its sign changed.
SignedColumn signed_column(const std::string& text, double scale) {
  const bool minus = !text.empty() && text.front() == '-';
  return {minus ? text.substr(1) : text, minus ? -scale : scale};
}

Channel read_channel(Section& s, const Units& units) {
  Channel c;
  const double scale = read_scale(s, units);
  for (const std::string& axis : s.texts("axes")) c.axes.push_back(signed_column(axis, scale));
  c.quantum = std::abs(scale) * number_or(s, "quantum", 0.0, 0.0, 1e9);
  c.range = std::abs(scale) * number_or(s, "range", 0.0, 0.0, 1e9);
  c.delay_s = number_or(s, "delay_s", 0.0, 0.0, 1.0);
  c.low_pass_hz = number_or(s, "low_pass_hz", 0.0, 0.1, 1e6);
  s.finish();
  return c;
}

Channel read_imu(Section s, const Units& units) {
  Channel c = read_channel(s, units);
  if (c.axes.size() != 3) s.fail("axes", "expected three columns: x, y and z");
  return c;
}

Channel read_kind(Section s, const std::map<std::string, Units>& kinds) {
  std::vector<std::string> names;
  names.reserve(kinds.size());
  for (const auto& [name, units] : kinds) names.push_back(name);
  const std::string kind = names[s.choice("kind", names)];
  Channel c = read_channel(s, kinds.at(kind));
  c.kind = kind;
  return c;
}

void read_time(Section s, ImportMap* map) {
  const bool column = s.has("column");
  const bool step = s.has("step");
  if (column + step + s.has("rate_hz") != 1) s.fail("column", "expected one of column, step, rate_hz");
  if (column || step) {
    map->time = signed_column(s.text(column ? "column" : "step"), read_scale(s, kTime));
    map->time_is_step = step;
  } else {
    map->rate_hz = s.number("rate_hz", 1.0, 1e6);
  }
  map->from_s = number_or(s, "from_s", map->from_s, 0.0, 1e9);
  map->to_s = number_or(s, "to_s", map->to_s, map->from_s, 1e9);
  s.finish();
}

TableShape read_shape(Section s) {
  TableShape shape;
  shape.float32 = s.has("format") && s.choice("format", {"text", "float32"}) == 1;
  if (s.has("columns")) shape.columns = s.texts("columns");
  if (s.has("header_bytes")) shape.header_bytes = s.integer("header_bytes", 0, 1 << 20);
  s.finish();
  return shape;
}

/// What every table has: time, wheels, drive, battery.
void read_motion(Section& root, ImportMap* map) {
  if (root.has("source")) {
    Section source = root.table("source");
    for (const char* key : {"repository", "commit", "path", "licence", "sha256"})
      if (source.has(key)) map->source[key] = source.text(key);
    source.finish();
  }
  if (root.has("table")) map->table = read_shape(root.table("table"));
  read_time(root.table("time"), map);
  map->wheels = read_kind(root.table("wheels"), {{"angle", kAngle}, {"rate", kWheelRate}});
  map->drive = read_kind(root.table("drive"), {{"volts", kVolts}, {"duty", kDuty}, {"torque", kTorque}});
  Section battery = root.table("battery");
  if (battery.has("column")) {
    map->battery = signed_column(battery.text("column"), read_scale(battery, kVolts));
  } else {
    map->battery_V = battery.number("volts", 0.1, 1000.0);
  }
  battery.finish();
}

void read_tilt(Section s, ImportMap* map) {
  if (s.has("axes")) {
    map->tilt = read_channel(s, kAngle);
    return;
  }
  map->tilt.axes = {signed_column(s.text("column"), read_scale(s, kAngle))};
  s.finish();
}

ImportMap read_robots_map(const std::string& path, bool imu) {
  const Document document(path, {});
  Section root(document, document.root(), "");
  ImportMap map;
  map.robot = (std::filesystem::path(path).parent_path() / root.text("robot")).lexically_normal().string();
  read_motion(root, &map);
  if (root.has("balancing")) {
    for (Section& s : root.tables("balancing", 1, 1000)) {
      const double from_s = s.number("from_s", 0.0, 1e9);
      map.balancing.push_back({from_s, s.number("to_s", from_s, 1e9)});
      s.finish();
    }
  }
  if (imu && !root.has("gyro")) {
    throw ConfigError(path + ": has no [gyro]; a log without raw gyro: ./tools/lab identify TABLE --map " +
                      path);
  }
  if (imu || root.has("gyro")) map.gyro = read_imu(root.table("gyro"), kRate);
  if (imu || root.has("accel")) map.accel = read_imu(root.table("accel"), kAcceleration);
  if (!imu || root.has("tilt")) read_tilt(root.table("tilt"), &map);
  root.finish();
  return map;
}

}  // namespace

ImportMap read_import_map(const std::string& path) { return read_robots_map(path, true); }
ImportMap read_motion_map(const std::string& path) { return read_robots_map(path, false); }

ImportMap read_bench_map(const std::string& path) {
  const Document document(path, {});
  Section root(document, document.root(), "");
  ImportMap map;
  read_motion(root, &map);
  Section current = root.table("current");
  map.current = read_channel(current, {{"A", 1.0}, {"mA", 1e-3}});
  if (root.has("published")) {  // what ./tools/reality compares with
    Section published = root.table("published");
    for (const char* key : {"resistance_ohm", "torque_constant_N_m_A"}) published.number(key, 0.0, 1e6);
    published.finish();
  }
  root.finish();
  return map;
}

}  // namespace equipoise::app
