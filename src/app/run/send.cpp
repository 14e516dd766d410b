// `equipoise send`: asks one robot for one thing, and says success only when the robot has confirmed it.
#include <unistd.h>

#include <cstdio>

#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/run/conversation.hpp"
#include "app/run/wires.hpp"

namespace equipoise::app {
namespace {

int send(const SendArguments& a) {
  Conversation conversation(a, runtime::CommandKeys::load(a.key));
  watch_interrupts();
  conversation.find_robots();
  if (a.live) {
    conversation.relay(STDIN_FILENO);
    return 0;
  }
  if (a.disarm) {
    conversation.disarm_all();
    std::printf("disarmed\n");
    return 0;
  }
  if (a.heading_reset) conversation.begin_turn(signed_command_t::HEADING_RESET, "reset its heading");
  if (a.arm) {
    conversation.begin_turn(signed_command_t::ARM, "arm");
    conversation.wait_until_armed();
    std::printf("armed\n");
  }
  if (a.drive) std::printf("%lld commands accepted\n", static_cast<long long>(conversation.drive()));
  return 0;
}

}  // namespace

void add_send(Subcommand app) {
  const Subcommand command = app.subcommand("send", "Commands a robot that runs with --command-key")
                                 .example("equipoise send --key anna.key --drive-mps 0.1 --duration-s 5");
  auto a = std::make_shared<SendArguments>();
  command.option("--key", a->key, "key file, see keygen").file().required();
  command.option("--url", a->url, std::string("the robot's --command-url: ") + kWireHelp).show_default();
  command.option("--robot", a->robot, "the robot's --robot-name (default: as in the key)");
  command.option("--as", a->holder, "your name, with a robot's own key (default: owner)");
  const Option forward = command.option("--drive-mps", a->drive_mps, "forward, m/s").range(-2.0, 2.0);
  const Option sideways =
      command.option("--sideways-mps", a->sideways_mps, "to the left, m/s").range(-2.0, 2.0);
  const Option yaw = command.option("--yaw-hz", a->yaw_hz, "yaw rate, turns per second").range(-5.0, 5.0);
  const Option arm = command.flag("--arm,!--disarm", a->arm, "motors on, or off until a sender arms again");
  command.flag("--heading-reset", a->heading_reset, "forward is where the robot points now");
  const Option duration = command.option("--duration-s", a->duration_s, "repeat the motion for this long, s")
                              .show_default()
                              .range(0.0, 360000.0);
  command.option("--timeout-s", a->timeout_s, "longest wait for the robot, s")
      .show_default()
      .range(0.1, 60.0);
  const Option live =
      command.flag("--live", a->live,
                   "lines from stdin: arm, disarm, heading-reset, take, or drive FORWARD LEFT "
                   "YAW (m/s, m/s, turns/s) for one command; its state as JSON lines");
  command.action([=] {
    const bool motion = forward.given() || sideways.given() || yaw.given();
    if (live.given() && (motion || arm.given() || a->heading_reset || duration.given()))
      throw InputError("--live: what to do comes from stdin");
    a->disarm = arm.given() && !a->arm;
    if (a->disarm && (motion || a->heading_reset))
      throw InputError("--disarm cannot be combined with motion options");
    a->drive = motion || duration.given() || !(arm.given() || a->heading_reset);
    return send(*a);
  });
}

}  // namespace equipoise::app
