// `equipoise keygen`: keys of robots and of their holders.
#include <cstdio>

#include "app/cli/commands.hpp"
#include "equipoise/runtime/command_key.hpp"

namespace equipoise::app {

void add_keygen(Subcommand app) {
  struct Arguments {
    std::string path;
    std::string robot = "robot";
    std::string holder;
    std::string from;
    bool rotate = false;
  };
  const Subcommand command =
      app.subcommand("keygen", "Makes the key of a robot, or of a user who may command it")
          .example("equipoise keygen robot.key --robot mbbr-1");
  auto a = std::make_shared<Arguments>();
  command.option("file", a->path, "new file, for its owner only; copy a robot's to the robot")
      .file()
      .required();
  const Option robot = command.option("--robot", a->robot, "the robot's name").show_default();
  const Option holder = command.option("--holder", a->holder, "a key for this user, from the robot's own");
  const Option from = command.option("--from", a->from, "the robot's own key").file().needs(holder);
  const Option rotate = command.flag(
      "--rotate", a->rotate, "a new secret in a robot's file: its holders need new keys from then on");
  holder.needs(from).excludes(robot);
  rotate.excludes(robot).excludes(holder);
  command.action([=] {
    if (a->rotate) {
      runtime::CommandKeys::rotate(a->path);
    } else if (!a->holder.empty()) {
      runtime::CommandKeys::load(a->from).of_holder(a->holder).save(a->path);
    } else {
      runtime::CommandKeys::create(a->path, a->robot);
    }
    std::printf("%s\n", a->path.c_str());
    return 0;
  });
}

}  // namespace equipoise::app
