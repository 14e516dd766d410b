#include <sys/resource.h>

#include <csignal>
#include <cstdio>
#include <exception>

#include "app/cli/commands.hpp"
#include "app/text/files.hpp"
#include "equipoise/config.hpp"

namespace {
void say(const std::exception& error) {
  std::fprintf(stderr, "equipoise: %s\n", equipoise::app::printable(error.what()).c_str());
}

/// With fewer LCM waits for ever.
bool has_descriptors() {
  constexpr rlim_t kLeast = 32;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= kLeast) return true;
  std::fprintf(stderr, "equipoise: only %llu files may be open; 32 are needed (ulimit -n)\n",
               static_cast<unsigned long long>(limit.rlim_cur));
  return false;
}
}  // namespace

/// Exit codes: 0 success, 1 a job that failed, 2 bad usage or input.
int main(int argc, char** argv) {
  // A closed pipe or a full disk is an error to report, not a reason to vanish.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  if (!has_descriptors()) return 2;
  try {
    equipoise::app::CommandLine line("Equipoise: firmware and simulator of two balancing robots",
                                     EQUIPOISE_VERSION);
    equipoise::app::add_commands(line.root());
    return line.run(argc, argv);
  } catch (const equipoise::ConfigError& error) {
    say(error);
    return 2;
  } catch (const equipoise::app::InputError& error) {
    say(error);
    return 2;
  } catch (const std::exception& error) {
    say(error);
    return 1;
  }
}
