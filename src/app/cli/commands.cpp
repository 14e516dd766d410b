#include "app/cli/commands.hpp"

namespace equipoise::app {

void add_commands(Subcommand app) {
  for (AddCommand* add :
       {add_sim,        add_run,      add_replay,      add_import,       add_convert,   add_keygen,
        add_send,       add_remote,   add_model,       add_bridge,       add_geometry,  add_config,
        add_design,     add_attitude, add_motor_bench, add_friction_rig, add_identify,  add_bench,
        add_campaign,   add_trials,   add_guard,       add_doctor,       add_calibrate, add_bringup,
        add_completion, add_man})
    add(app);
}

}  // namespace equipoise::app
