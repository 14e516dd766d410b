#include <fstream>
#include <memory>

#include "commands.hpp"
#include "equipoise/config.hpp"
#include "identification.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string log;
  std::string out;
  std::string json;
  double inertia_kg_m2 = 0.0;
  FrictionRig rig;
};

/// Only what the data determine goes into the fragment; the names are those of the configuration.
void write_fragment(const Arguments& a, const std::string& table, const std::vector<std::string>& keys,
                    const Identified& found) {
  std::ofstream file(a.out);
  file.precision(5);
  file << "# Identified from " << a.log << "; name it in the configuration: include = [\"" << a.out
       << "\"]\n[" << table << "]\n";
  for (const std::string& key : keys) {
    const Estimate* e = found.find(key);
    if (e == nullptr) continue;
    if (e->determined()) {
      file << key << " = " << e->value << "  # +- " << e->half_width << ", 95 %\n";
    } else {
      file << "# " << key << ": the data do not determine it\n";
    }
  }
  if (!file.flush()) throw InputError(a.out + ": cannot be written");
}

int report(const Arguments& a, const Identified& found, const std::string& table,
           const std::vector<std::string>& keys) {
  if (!found.refused.empty()) throw InputError(a.log + ": " + found.refused);
  std::FILE* const out = a.json == "-" ? stderr : stdout;
  nlohmann::json estimates = nlohmann::json::object();
  for (const Estimate& e : found.estimates) {
    estimates[e.name] = {{"value", e.value}, {"half_width_95", e.half_width}, {"determined", e.determined()}};
    std::fprintf(out, "%-32s %12.5g +- %-10.2g %s\n", e.name.c_str(), e.value, e.half_width,
                 e.determined() ? "" : "not determined by these data");
  }
  std::fprintf(out, "R^2 %.4f", found.r_squared);
  if (found.r_squared_torque != 0.0) std::fprintf(out, ", of the torque %.4f", found.r_squared_torque);
  std::fprintf(out, "\n");
  if (!a.out.empty()) write_fragment(a, table, keys, found);
  if (!a.json.empty()) {
    write_json({{"log", a.log}, {"estimates", estimates}, {"r_squared", found.r_squared}}, a.json);
  }
  return 0;
}

}  // namespace

void add_identify(CLI::App& app, int* status) {
  auto* command = app.add_subcommand("identify", "Parameters from bench logs, with confidence intervals");
  command->require_subcommand(1);
  auto a = std::make_shared<Arguments>();
  const auto common = [a](CLI::App* sub) {
    sub->add_option("log", a->log, "LCM event log with EQUIPOISE_BENCH")->required();
    sub->add_option("--out", a->out, "TOML fragment for the configuration's include");
    sub->add_option("--json", a->json, "output file, - for stdout");
  };
  auto* motor = command->add_subcommand("motor", "R, k, L and friction from a drive/brake log");
  common(motor);
  motor->add_option("--inertia-kg-m2", a->inertia_kg_m2, "of the flywheel, when it is known")
      ->check(CLI::Range(1e-7, 10.0));
  motor->callback([=] {
    *status = report(*a, identify_motor(read_bench_log(a->log), a->inertia_kg_m2), "motor",
                     {"resistance_ohm", "torque_constant_N_m_A", "inductance_H"});
  });
  auto* friction =
      command->add_subcommand("friction", "J_f, mu_c, mu_v of a ball on a flywheel, [T] (5.34)-(5.37)");
  common(friction);
  friction->add_option("--k1-N-m", a->rig.k1_N_m, "torque about the ball per unit of u")
      ->capture_default_str();
  friction->add_option("--k2-ball-N-m-s", a->rig.k2_ball_N_m_s, "back-EMF about the ball")
      ->capture_default_str();
  friction
      ->add_option("--radius-ratio", a->rig.flywheel_over_ball_radius, "flywheel's radius over the ball's")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 100.0));
  friction->add_flag("--separate-directions", a->rig.separate_directions, "Coulomb friction per direction");
  friction->add_flag("--stribeck", a->rig.stribeck, "excess at low speed");
  friction->callback([=] {
    *status = report(*a, identify_friction(read_bench_log(a->log), a->rig), "robot",
                     {"coulomb_friction_N_m", "viscous_friction_N_m_s"});
  });
}

}  // namespace equipoise::app
