// `equipoise import`.
#include <cstdio>

#include "app/cli/commands.hpp"
#include "app/import/checks.hpp"
#include "app/text/json.hpp"
#include "app/text/version.hpp"
#include "equipoise/runtime/telemetry.hpp"

namespace equipoise::app {
namespace {

struct ImportArguments {
  std::string table, map, log, json, motion;
};

void write_log(const std::string& path, const std::vector<runtime::TickRecord>& ticks,
               const ImportedRobot& robot) {
  runtime::TelemetryOptions options;
  options.log_path = path;
  options.wait_when_full = true;
  options.run = robot.run;
  try {
    runtime::Telemetry log(options);
    for (const runtime::TickRecord& tick : ticks) log.hand_over(tick);
    runtime::EndRecord end;
    end.fell_at_s = kNotGiven;
    end.duration_s = static_cast<double>(ticks.size()) * kTickS;
    const runtime::TelemetryReport report = log.finish(end);
    if (!report.log_error.empty()) throw InputError(report.log_error);
  } catch (const std::runtime_error& error) {
    throw InputError(path + ": " + error.what());
  }
}

nlohmann::json to_json(const ImportArguments& a, const ImportMap& map, const ImportedRobot& robot,
                       const std::vector<runtime::TickRecord>& ticks, const std::vector<Check>& checks) {
  std::int64_t fresh = 0;
  std::int64_t balancing = 0;
  for (const runtime::TickRecord& tick : ticks) {
    fresh += imu_ok(tick.raw);
    balancing += tick.arm;
  }
  nlohmann::json list = nlohmann::json::array();
  nlohmann::json wrong = nlohmann::json::array();
  for (const Check& c : checks) {
    list.push_back({{"name", c.name},
                    {"ok", c.ok ? nlohmann::json(*c.ok) : nlohmann::json(nullptr)},
                    {"value", c.value},  // null where there is none
                    {"text", c.text}});
    if (c.ok && !*c.ok) wrong.push_back(c.name);
  }
  return {{"table", a.table},
          {"log", a.log},
          {"robot", robot.run.robot},
          {"config", map.robot},
          {"config_sha256", robot.run.config_sha256},
          {"source", map.source},
          {"ticks", ticks.size()},
          {"fresh_ticks", fresh},
          {"balancing_s", static_cast<double>(balancing) * kTickS},
          {"checks", list},
          {"checks_failed", wrong},
          {"version", version()}};
}

/// Each row's tilt, rolling and drive about the axes that the robot balances about.
int write_motion(const ImportArguments& a) {
  const ImportMap map = read_motion_map(a.map);
  const ImportedRobot robot = imported_robot(map.robot);
  const ImportedRows rows = imported_rows(read_table(a.table, map.table), map, robot);
  nlohmann::json axes = nlohmann::json::array();
  for (std::size_t i = 0; i < map.tilt.axes.size(); ++i) {
    const auto axis = static_cast<int>(i);
    std::vector<double> tilt, rolling, drive;
    for (std::size_t k = 0; k < rows.t_s.size(); ++k) {
      tilt.push_back(rows.tilt_rad[k](axis));
      rolling.push_back(robot.rolling(rows.wheel_rad[k])(axis));
      drive.push_back(robot.input(rows.drive[k])[i]);
    }
    axes.push_back({{"tilt_rad", tilt}, {"rolling_rad", rolling}, {"drive", drive}});
  }
  nlohmann::json balancing = nlohmann::json::array();
  for (const Stretch& s : map.balancing) balancing.push_back({s.from_s, s.to_s});
  write_json({{"config", map.robot}, {"t_s", rows.t_s}, {"axes", axes}, {"balancing_s", balancing}},
             a.motion);
  return 0;
}

int import(const ImportArguments& a) {
  if (a.motion.empty() == a.log.empty()) throw InputError("either --out or --motion");
  if (!a.motion.empty()) return write_motion(a);
  const ImportMap map = read_import_map(a.map);
  const ImportedRobot robot = imported_robot(map.robot);
  const Table table = read_table(a.table, map.table);
  const ImportedRows rows = imported_rows(table, map, robot);
  const std::vector<runtime::TickRecord> ticks = imported_ticks(rows, map, robot);
  const std::vector<Check> checks = check_import(table, rows, map, robot);
  write_log(a.log, ticks, robot);
  std::FILE* out = a.json == "-" ? stderr : stdout;
  std::fprintf(out, "%s: %zu ticks of 5 ms, %.3f s\n", a.log.c_str(), ticks.size(),
               static_cast<double>(ticks.size()) * kTickS);
  for (const Check& c : checks) {
    std::fprintf(out, "  %-5s %-18s %s\n",
                 !c.ok   ? "-"
                 : *c.ok ? "ok"
                         : "WRONG",
                 c.name.c_str(), c.text.c_str());
  }
  if (!a.json.empty()) write_json(to_json(a, map, robot, ticks, checks), a.json);
  return 0;
}

}  // namespace

void add_import(Subcommand app) {
  const Subcommand command =
      app.subcommand("import",
                     "Makes a log of another robot's table, and checks that the table is what its map says")
          .example(
              "equipoise import LOG278.TXT --map config/real/maps/mini_segway_log278.toml -o segway.lcm");
  auto a = std::make_shared<ImportArguments>();
  command.option("table", a->table, "CSV, columns by blanks, or rows of float32").file().required();
  command.option("--map", a->map, "TOML: columns, units, axes, time, drive; docs/reality.md")
      .file()
      .required();
  command.option("-o,--out", a->log, "LCM event log to write").file();
  command
      .option(
          "--motion", a->motion,
          "instead: each row's tilt, rolling and drive as JSON, - for stdout; needs no gyro or accelerometer")
      .file();
  command.option("--json", a->json, "result as JSON, - for stdout").file();
  command.action([=] { return import(*a); });
}

}  // namespace equipoise::app
