// The subcommands: each adds itself to the command line.
#pragma once

#include "app/cli/command_line.hpp"
#include "app/text/errors.hpp"

namespace equipoise::app {

void add_commands(Subcommand app);

void add_sim(Subcommand app);
void add_run(Subcommand app);
void add_convert(Subcommand app);
void add_keygen(Subcommand app);
void add_send(Subcommand app);
void add_remote(Subcommand app);
void add_replay(Subcommand app);
void add_import(Subcommand app);
void add_model(Subcommand app);
void add_bridge(Subcommand app);
void add_geometry(Subcommand app);
void add_config(Subcommand app);
void add_design(Subcommand app);
void add_attitude(Subcommand app);
void add_motor_bench(Subcommand app);
void add_friction_rig(Subcommand app);
void add_identify(Subcommand app);
void add_bench(Subcommand app);
void add_campaign(Subcommand app);
void add_trials(Subcommand app);
void add_guard(Subcommand app);
void add_doctor(Subcommand app);
void add_calibrate(Subcommand app);
void add_bringup(Subcommand app);
void add_completion(Subcommand app);
void add_man(Subcommand app);

}  // namespace equipoise::app
