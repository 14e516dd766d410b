#include "equipoise/plant/friction_rig.hpp"

#include <memory>

#include "bench_log.hpp"
#include "commands.hpp"

namespace equipoise::app {

void add_friction_rig(CLI::App& app, int* status) {
  auto* command = app.add_subcommand("friction-rig", "Simulated friction bench: the ball drives a flywheel");
  auto p = std::make_shared<FrictionRigParams>();
  auto log = std::make_shared<std::string>();
  command->add_option("--log", *log, "LCM event log, for identify friction")->required();
  command->add_option("--coulomb-N-m", p->coulomb_N_m)->capture_default_str()->check(CLI::Range(0.0, 1.0));
  command->add_option("--viscous-N-m-s", p->viscous_N_m_s)
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--static-ratio", p->static_ratio, "breakaway over Coulomb friction")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 5.0));
  command->add_option("--negative-scale", p->negative_scale, "Coulomb friction backwards over forwards")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 10.0));
  command->add_option("--amplitude-u", p->amplitude_u)->capture_default_str()->check(CLI::Range(0.0, 3.0));
  command->add_option("--seed", p->seed)->capture_default_str();
  command->callback([=] {
    BenchLog out;
    out.axis = 1;
    out.rows = run_friction_rig(*p);
    write_bench_log(*log, out);
    *status = 0;
  });
}

}  // namespace equipoise::app
