#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>

#include "app/cli/commands.hpp"
#include "app/identify/identification.hpp"
#include "app/text/files.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

struct IdentifyArguments {
  std::string log;
  std::string out;
  std::string json;
  std::string map;
  int motor = 1;
  double inertia_kg_m2 = 0.0;
  FrictionRig rig;
};

/// What becomes part of a configuration: the table and its keys.
struct Keys {
  std::string table;
  std::vector<std::string> keys;
};

/// Only what the data determine goes into the fragment; the rest is said in comments.
void write_fragment(const IdentifyArguments& a, const Keys& wanted, const Identified& found) {
  const std::string beginning = "# Identified from ";
  check_output(a.out, {beginning}, "identified parameters");
  std::ofstream file(a.out);
  file.precision(5);
  file << beginning << a.log << "; in a configuration beside this file: include = ["
       << std::filesystem::path(a.out).filename() << "]\n";
  const auto is_key = [&](const std::string& name) {
    return std::find(wanted.keys.begin(), wanted.keys.end(), name) != wanted.keys.end();
  };
  for (const Estimate& e : found.estimates) {
    if (!e.determined()) {
      file << "# " << e.name << ": the data do not determine it\n";
    } else if (!is_key(e.name)) {
      file << "# " << e.name << " = " << e.value << "  # +- " << e.half_width << ", 95 %\n";
    }
  }
  file << "[" << wanted.table << "]\n";
  for (const std::string& key : wanted.keys) {
    const Estimate* e = found.find(key);
    if (e == nullptr || !e->determined()) continue;
    file << key << " = " << e->value << "  # +- " << e->half_width << ", 95 %\n";
  }
  if (!file.flush()) throw InputError(a.out + ": cannot be written");
}

void print(const Identified& found, std::FILE* out) {
  for (const Estimate& e : found.estimates) {
    std::fprintf(out, "%-32s %12.5g +- %-10.2g %s\n", e.name.c_str(), e.value, e.half_width,
                 e.determined() ? "" : "not determined by these data");
  }
  std::fprintf(out, "R^2 %.4f", found.r_squared);
  if (found.r_squared_torque != 0.0) std::fprintf(out, ", of the torque %.4f", found.r_squared_torque);
  std::fprintf(out, "\n");
}

nlohmann::json to_json(const IdentifyArguments& a, const Identified& found) {
  nlohmann::json estimates = nlohmann::json::object();
  for (const Estimate& e : found.estimates) {
    estimates[e.name] = {{"value", e.value},
                         {"half_width_95", e.half_width},  // infinite: null
                         {"determined", e.determined()}};
  }
  nlohmann::json json{{"log", a.log}, {"estimates", estimates}, {"r_squared", found.r_squared}};
  if (found.r_squared_torque != 0.0) json["r_squared_torque"] = found.r_squared_torque;
  return json;
}

int report(const IdentifyArguments& a, const Identified& found, const Keys& wanted) {
  if (!found.refused.empty()) throw InputError(a.log + ": " + found.refused);
  print(found, a.json == "-" ? stderr : stdout);
  if (!a.out.empty()) write_fragment(a, wanted, found);
  if (!a.json.empty()) write_json(to_json(a, found), a.json);
  return 0;
}

void add_common(Subcommand command, const std::shared_ptr<IdentifyArguments>& a) {
  command.option("log", a->log, "log of a bench: LCM with EQUIPOISE_BENCH, or CSV").file().required();
  command.option("--out", a->out, "TOML fragment for the configuration's include").file();
  command.option("--json", a->json, "output file, - for stdout").file();
}

void add_motor(Subcommand identify, const std::shared_ptr<IdentifyArguments>& a) {
  const Subcommand motor = identify.subcommand("motor", "R, k, L and friction from a drive/brake log")
                               .example("equipoise identify motor bench.lcm --out motor.toml");
  add_common(motor, a);
  motor.option("--inertia-kg-m2", a->inertia_kg_m2, "of the flywheel, when it is known").range(1e-7, 10.0);
  const Option map =
      motor
          .option("--map", a->map, "TOML: what the columns of another recorder's table mean; docs/reality.md")
          .file();
  motor.option("--motor", a->motor, "which of the map's motors").show_default().range(1, 4).needs(map);
  motor.action([=] {
    const BenchLog log = a->map.empty() ? read_bench_log(a->log) : read_bench_table(a->log, a->map, a->motor);
    return report(*a, identify_motor(log, a->inertia_kg_m2),
                  {"motor", {"resistance_ohm", "torque_constant_N_m_A", "inductance_H"}});
  });
}

void add_friction(Subcommand identify, const std::shared_ptr<IdentifyArguments>& a) {
  const Subcommand friction =
      identify.subcommand("friction", "J_f, mu_c, mu_v of a ball on a flywheel, [T] (5.34)-(5.37)")
          .example("equipoise identify friction rig.lcm --out friction.toml");
  add_common(friction, a);
  friction.option("--k1-N-m", a->rig.k1_N_m, "torque about the ball per unit of u")
      .show_default()
      .range(1e-6, 100.0);
  friction.option("--k2-ball-N-m-s", a->rig.k2_ball_N_m_s, "back-EMF about the ball")
      .show_default()
      .range(0.0, 10.0);
  friction
      .option("--radius-ratio", a->rig.flywheel_over_ball_radius,
              "flywheel's radius over the ball's; default: the log's")
      .range(0.01, 100.0);
  friction.flag("--separate-directions", a->rig.separate_directions, "Coulomb friction per direction");
  friction.flag("--stribeck", a->rig.stribeck, "excess at low speed");
  friction.action([=] {
    return report(*a, identify_friction(read_bench_log(a->log), a->rig),
                  {"robot", {"coulomb_friction_N_m", "viscous_friction_N_m_s"}});
  });
}

}  // namespace

void add_identify(Subcommand app) {
  const Subcommand command =
      app.subcommand("identify", "Parameters from bench logs, with confidence intervals")
          .example("equipoise identify motor bench.lcm --out motor.toml");
  command.require_subcommand();
  auto a = std::make_shared<IdentifyArguments>();
  add_motor(command, a);
  add_friction(command, a);
}

}  // namespace equipoise::app
