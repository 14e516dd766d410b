#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

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

/// Started without one of them (2>&-), its messages would go into the first file or device that it opens.
void hold_standard_descriptors() {
  for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; ++fd)
    if (fcntl(fd, F_GETFD) < 0) (void)open("/dev/null", O_RDWR);  // the lowest that is free: this one
}

/// A result that a full disk did not take is no success; who reads a pipe may stop when he likes.
bool is_stdout_lost() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return false;
  struct stat what {};
  return fstat(STDOUT_FILENO, &what) != 0 || !(S_ISFIFO(what.st_mode) || S_ISSOCK(what.st_mode));
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
  hold_standard_descriptors();
  if (!has_descriptors()) return 2;
  try {
    equipoise::app::CommandLine line("Equipoise: firmware and simulator of two balancing robots",
                                     EQUIPOISE_VERSION);
    equipoise::app::add_commands(line.root());
    const int status = line.run(argc, argv);
    if (!is_stdout_lost()) return status;
    std::fprintf(stderr, "equipoise: standard output: cannot be written\n");
    return status == 0 ? 1 : status;
  } catch (const equipoise::ConfigError& error) {
    say(error);
    return 2;
  } catch (const std::exception& error) {
    say(error);
    return 1;
  }
}
