#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>

#include "app/commands.hpp"
#include "equipoise/config.hpp"

namespace {

int run(int argc, char** argv) {
  // A closed pipe or a full disk is an error to report, not a reason to vanish.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  CLI::App app{"Equipoise: firmware and simulator of two balancing robots"};
  app.set_version_flag("--version", EQUIPOISE_VERSION);
  app.require_subcommand(1);
  app.fallthrough(false);
  int status = 0;
  equipoise::app::add_commands(app, &status);
  try {
    app.parse(argc, argv);
    return status;
  } catch (const CLI::ParseError& error) {
    const bool help = error.get_exit_code() == 0;
    app.exit(error);
    return help ? 0 : 2;
  }
}

}  // namespace

/// Exit codes: 0 success, 1 a job that failed, 2 bad usage or input.
int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const equipoise::ConfigError& error) {
    std::fprintf(stderr, "equipoise: %s\n", error.what());
    return 2;
  } catch (const equipoise::app::InputError& error) {
    std::fprintf(stderr, "equipoise: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "equipoise: %s\n", error.what());
    return 1;
  }
}
