#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>

#include "app/cli/commands.hpp"
#include "app/log/flight_log.hpp"
#include "app/log/mcap_writer.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string log;
  std::string to;
  std::string out;
};

/// Name and value of every number of a tick, channel by channel.
using Visit = std::function<void(const std::string& channel, const std::string& field, double value)>;

template <std::size_t N>
void each(const Visit& visit, const std::string& channel, const std::string& field,
          const double (&values)[N]) {
  for (std::size_t i = 0; i < N; ++i) visit(channel, field + "_" + std::to_string(i), values[i]);
}

void visit_state(const Visit& visit, const std::string& channel, const state_t& s) {
  each(visit, channel, "theta_rad", s.theta_rad);
  each(visit, channel, "omega_B_rad_s", s.omega_B_rad_s);
  each(visit, channel, "phi_rad", s.phi_rad);
  each(visit, channel, "phi_dot_rad_s", s.phi_dot_rad_s);
  each(visit, channel, "position_W_m", s.position_W_m);
  visit(channel, "normalized_innovation", s.normalized_innovation);
}

void visit_tick(const LoggedTick& t, const Visit& visit) {
  each(visit, "sensors", "gyro_counts", t.sensors.gyro_counts);
  each(visit, "sensors", "accel_counts", t.sensors.accel_counts);
  each(visit, "sensors", "encoder_counts", t.sensors.encoder_counts);
  each(visit, "sensors", "attitude_wxyz", t.sensors.attitude_wxyz);
  visit("sensors", "battery_counts", t.sensors.battery_counts);
  visit("sensors", "valid", t.sensors.valid);
  visit("sensors", "health", t.sensors.health);
  each(visit, "command", "velocity_W_m_s", t.command.velocity_W_m_s);
  visit("command", "yaw_rate_rad_s", t.command.yaw_rate_rad_s);
  visit("command", "arm", t.command.arm);
  visit("command", "heading_reset", t.command.heading_reset);
  visit_state(visit, "state", t.estimate);
  visit_state(visit, "reference", t.reference);
  if (t.has_truth) visit_state(visit, "truth", t.truth);
  each(visit, "motors", "u_lin", t.motors.u_lin);
  each(visit, "motors", "u_friction", t.motors.u_friction);
  each(visit, "motors", "duty", t.motors.duty);
  visit("motors", "enable", t.motors.enable);
  visit("motors", "saturated", t.motors.saturated);
  visit("health", "arm_state", t.health.arm_state);
  visit("health", "reasons", t.health.reasons);
  visit("health", "battery_V", t.health.battery_V);
}

/// One row per tick; columns channel.field. The values read back as the same doubles.
void write_csv(const FlightLog& log, std::ostream& out) {
  out << "t_s,tick";
  visit_tick(log.ticks.front(), [&](const std::string& channel, const std::string& field, double) {
    out << ',' << channel << '.' << field;
  });
  char text[40];
  for (const LoggedTick& tick : log.ticks) {
    std::snprintf(text, sizeof text, "\n%.6f,%lld", static_cast<double>(tick.sensors.utime) * 1e-6,
                  static_cast<long long>(tick.sensors.tick));
    out << text;
    visit_tick(tick, [&](const std::string&, const std::string&, double value) {
      std::snprintf(text, sizeof text, ",%.17g", value);
      out << text;
    });
  }
  out << '\n';
}

/// One JSON message per channel and tick: what Foxglove plots without a plug-in.
void write_mcap(const FlightLog& log, std::ostream& out) {
  McapWriter mcap(out);
  mcap.metadata("run", {{"robot", log.run.robot},
                        {"estimator", log.run.estimator},
                        {"controller", log.run.controller},
                        {"fidelity", log.run.fidelity},
                        {"version", log.run.version},
                        {"config_sha256", log.run.config_sha256},
                        {"config_toml", log.run.config_toml}});
  for (const LoggedTick& tick : log.ticks) {
    std::map<std::string, nlohmann::json> messages;
    visit_tick(tick, [&](const std::string& channel, const std::string& field, double value) {
      messages[channel][field] = value;
    });
    for (auto& [channel, message] : messages) {
      message["tick"] = tick.sensors.tick;
      mcap.message("equipoise/" + channel, tick.sensors.utime * 1000, message);
    }
  }
  mcap.finish();
}

int convert(Arguments a) {
  const FlightLog log = read_flight_log(a.log);
  if (log.ticks.empty()) throw InputError(a.log + ": holds no whole tick");
  if (a.out.empty()) a.out = std::filesystem::path(a.log).replace_extension(a.to).string();
  std::ofstream file(a.out, std::ios::binary);
  if (a.to == "csv") {
    write_csv(log, file);
  } else {
    write_mcap(log, file);
  }
  if (!file.flush()) throw InputError(a.out + ": cannot be written");
  std::printf("%s: %zu ticks\n", a.out.c_str(), log.ticks.size());
  return 0;
}

}  // namespace

void add_convert(Subcommand app) {
  const Subcommand command = app.subcommand("convert", "Converts a log for other tools");
  auto a = std::make_shared<Arguments>();
  command.option("log", a->log, "LCM event log of sim or run").required();
  command.option("--to", a->to, "mcap (Foxglove) or csv").required().one_of({"mcap", "csv"});
  command.option("--out", a->out, "file to write (default: beside the log)");
  command.action([=] { return convert(*a); });
}

}  // namespace equipoise::app
