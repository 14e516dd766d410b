#include "commands.hpp"

namespace equipoise::app {

void add_commands(CLI::App& app, int* status) {
  add_sim(app, status);
  add_run(app, status);
  add_replay(app, status);
  add_convert(app, status);
  add_keygen(app, status);
  add_send(app, status);
  add_model(app, status);
  add_bridge(app, status);
  add_geometry(app, status);
  add_attitude(app, status);
  add_motor_bench(app, status);
  add_friction_rig(app, status);
  add_identify(app, status);
  add_bench(app, status);
  add_campaign(app, status);
  add_guard(app, status);
  add_doctor(app, status);
  add_calibrate(app, status);
  add_bringup(app, status);
}

}  // namespace equipoise::app
