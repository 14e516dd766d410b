#include "app/cli/commands.hpp"

namespace equipoise::app {

void add_commands(Subcommand app) {
  add_sim(app);
  add_run(app);
  add_replay(app);
  add_import(app);
  add_convert(app);
  add_keygen(app);
  add_send(app);
  add_remote(app);
  add_model(app);
  add_bridge(app);
  add_geometry(app);
  add_config(app);
  add_design(app);
  add_attitude(app);
  add_motor_bench(app);
  add_friction_rig(app);
  add_identify(app);
  add_bench(app);
  add_campaign(app);
  add_trials(app);
  add_guard(app);
  add_doctor(app);
  add_calibrate(app);
  add_bringup(app);
  add_completion(app);
  add_man(app);
}

}  // namespace equipoise::app
