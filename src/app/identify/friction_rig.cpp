#include "equipoise/plant/friction_rig.hpp"

#include <memory>

#include "app/cli/commands.hpp"
#include "app/identify/bench_log.hpp"

namespace equipoise::app {

void add_friction_rig(Subcommand app) {
  const Subcommand command =
      app.subcommand("friction-rig", "Simulated friction bench: the ball drives a flywheel")
          .example("equipoise friction-rig --log rig.lcm");
  auto p = std::make_shared<FrictionRigParams>();
  auto log = std::make_shared<std::string>();
  command.option("--log", *log, "LCM event log, for identify friction").file().required();
  command.option("--coulomb-N-m", p->coulomb_N_m, "Coulomb friction, N m").show_default().range(0.0, 1.0);
  command.option("--viscous-N-m-s", p->viscous_N_m_s, "viscous friction, N m s")
      .show_default()
      .range(0.0, 1.0);
  command.option("--radius-ratio", p->radius_ratio, "flywheel's radius over the ball's")
      .show_default()
      .range(0.01, 100.0);
  command.option("--static-ratio", p->static_ratio, "breakaway over Coulomb friction")
      .show_default()
      .range(1.0, 5.0);
  command.option("--negative-scale", p->negative_scale, "Coulomb friction backwards over forwards")
      .show_default()
      .range(0.1, 10.0);
  command.option("--amplitude-u", p->amplitude_u, "amplitude of the sweep, as u")
      .show_default()
      .range(0.0, 3.0);
  command.option("--seed", p->seed, "seed of every random number").show_default();
  command.action([=] {
    BenchLog out;
    out.axis = 1;
    out.radius_ratio = p->radius_ratio;
    out.rows = run_friction_rig(*p);
    write_bench_log(*log, out);
    return 0;
  });
}

}  // namespace equipoise::app
