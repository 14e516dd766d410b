#include "app/log/shadow.hpp"

#include <cmath>
#include <cstdio>
#include <numeric>

#include "app/log/shadow_run.hpp"
#include "app/text/errors.hpp"
#include "robots/robot_list.hpp"

namespace equipoise::app {
namespace {

double mean_of(const std::vector<double>& v) {
  if (v.empty()) return std::nan("");
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

double variance_of(const std::vector<double>& v) {
  const double mean = mean_of(v);
  double sum = 0.0;
  for (const double x : v) sum += (x - mean) * (x - mean);
  return v.empty() ? std::nan("") : sum / static_cast<double>(v.size());
}

nlohmann::json to_json(const Ahead::Errors& e) {
  return {{"tilt", e.tilt.value()}, {"wheel", e.wheel.value()}};
}

/// Of the axes that the robot has.
double tilt_std_rad(const Shadow& s) {
  RootMeanSquare all;
  for (const std::vector<double>& axis : s.tilt_error_rad)
    if (!axis.empty()) all.add(variance_of(axis));
  return all.value();
}

}  // namespace

/// What is no number is written as null.
nlohmann::json Shadow::json() const {
  nlohmann::json list = nlohmann::json::array();
  for (const ShadowAlarm& a : alarms) {
    list.push_back({{"t_s", a.t_s}, {"hypothesis", a.hypothesis}, {"ratio", a.ratio}, {"bound", a.bound}});
  }
  nlohmann::json out{{"judged_s", judged_s},
                     {"starts", starts},
                     {"alarms", list},
                     {"alarms_per_min", 60.0 * static_cast<double>(alarms.size()) / judged_s},
                     {"mount_rad", {mount_rad.x(), mount_rad.y()}},
                     {"tilt_std_rad", tilt_std_rad(*this)},
                     {"tilt_offset_rad", mean_of(tilt_error_rad[0])},
                     {"tilt_std_own_rad", std::sqrt(variance_of(own_tilt_error_rad))}};
  for (const auto& [row, square] : nis) out["nis"][row] = square.sum / square.count;
  for (const auto& [time, a] : ahead) {
    out["ahead"][time] = to_json(a.model);
    out["ahead"][time]["persistence"] = to_json(a.persistence);
    out["ahead"][time]["constant_rate"] = to_json(a.constant_rate);
  }
  for (const auto& [channel, square] : noise) {
    out["noise"][channel] = {{"log", square.value()}, {"configured", configured.at(channel)}};
  }
  return out;
}

void Shadow::print(std::FILE* out) const {
  std::fprintf(out, "  judged %.2f s of balancing, %d starts, %zu alarms\n", judged_s, starts, alarms.size());
  for (const ShadowAlarm& a : alarms) {
    std::fprintf(out, "    %.3f s  %s", a.t_s, a.hypothesis.c_str());
    if (std::isfinite(a.ratio)) std::fprintf(out, " (%.3g, limit %.3g)", a.ratio, a.bound);
    std::fputc('\n', out);
  }
  if (judged_s == 0.0) {
    for (const std::string& each : reason_names(refused))
      std::fprintf(out, "    not armed: %s\n", each.c_str());
    return;
  }
  std::fprintf(
      out, "  mount, beside the configured one, at which accelerometer and model agree: %.1f, %.1f mrad\n",
      1e3 * mount_rad.x(), 1e3 * mount_rad.y());
  std::fprintf(out, "  NIS per row:");
  for (const auto& [row, square] : nis)
    std::fprintf(out, "  %s %.2f", row.c_str(), square.sum / square.count);
  std::fputc('\n', out);
  if (const double tilt_rad = tilt_std_rad(*this); std::isfinite(tilt_rad)) {
    std::fprintf(out, "  tilt against the smoother %.2f mrad (constant offset of %.1f apart)\n",
                 1e3 * tilt_rad, 1e3 * mean_of(tilt_error_rad[0]));
  } else {
    std::fprintf(
        out, "  tilt against the smoother: no stretch is longer than it takes to settle, half a second\n");
  }
  for (const auto& each : ahead) {
    const std::string& time = each.first;
    const Ahead& a = each.second;
    const auto line = [&](const char* what, double unit, RootMeanSquare Ahead::Errors::*of) {
      std::fprintf(out, "  %5s ahead, %s: model %.2f, persistence %.2f, constant rate %.2f mrad\n",
                   time.c_str(), what, unit * (a.model.*of).value(), unit * (a.persistence.*of).value(),
                   unit * (a.constant_rate.*of).value());
    };
    line("tilt", 1e3, &Ahead::Errors::tilt);
    line("wheels", 1e3, &Ahead::Errors::wheel);
  }
  for (const auto& [channel, square] : noise) {
    std::fprintf(out, "  noise %-14s %.4f, world full %.4f\n", channel.c_str(), square.value(),
                 configured.at(channel));
  }
}

Shadow shadow_log(RunLog& log, const std::string& origin, const std::string& config,
                  const std::vector<std::string>& set) {
  if (!config.empty() && robot_type(config) != log.run().robot) {
    throw InputError(config + ": is of a robot of type " + robot_type(config) + ", the log of " +
                     log.run().robot);
  }
  const runtime::RunInfo& info = log.run();
  return with_robot(info.robot, origin, [&](auto robot) {
    using Robot = decltype(robot);
    const auto loaded = config.empty() ? Robot::parse(info.config_toml, origin + " (its configuration)", set)
                                       : Robot::load(config, set);
    Choice choice{"", "", info.backend == "import" ? "" : info.fidelity, false, "", ""};
    complete(ConfiguredRobotOf<Robot>::robot_type(), &choice);
    const auto c = Robot::apply(loaded.config, choice);
    std::vector<ShadowTick> ticks = shadow_ticks(log);
    if (ticks.empty()) throw InputError(origin + ": holds no whole tick");
    Shadow out = Robot::with_pipeline(c, choice.controller, [&](auto& pipeline) {
      return ShadowRun<std::decay_t<decltype(pipeline)>>(pipeline.params(), Robot::rolling_radius_m(c),
                                                         c.robot.l_a.z(), std::move(ticks))
          .run();
    });
    const WorldParams& world = c.world[fidelity_level("full")].common;
    for (const std::string axis : {"x", "y", "z"}) {
      out.configured["gyro_" + axis + "_rad_s"] = world.gyro_sigma_rad_s;
      out.configured["accel_" + axis + "_m_s2"] = world.accel_sigma_m_s2;
    }
    return out;
  });
}

}  // namespace equipoise::app
