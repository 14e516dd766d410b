#include "guard_process.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <vector>

namespace equipoise::app {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(2);
constexpr int kStartPolls = 2500;  // 5 s: a slow board that has just booted
constexpr int kEndPolls = 500;     // 1 s

/// Ours without the service manager's socket: the guard must not answer for the loop.
std::vector<char*> environment() {
  std::vector<char*> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (std::strncmp(*variable, "NOTIFY_SOCKET=", 14) != 0) variables.push_back(*variable);
  }
  variables.push_back(nullptr);
  return variables;
}

pid_t spawn(std::vector<std::string> arguments) {
  std::vector<char*> argv(arguments.size());
  std::transform(arguments.begin(), arguments.end(), argv.begin(), [](std::string& a) { return a.data(); });
  argv.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // A group of its own: Ctrl-C in the terminal is for the loop, which then stops the guard.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t pid = 0;
  const int error =
      posix_spawn(&pid, "/proc/self/exe", nullptr, &attributes, argv.data(), environment().data());
  posix_spawnattr_destroy(&attributes);
  if (error != 0)
    throw std::runtime_error(std::string("the guard cannot be started: ") + std::strerror(error));
  return pid;
}

}  // namespace

GuardProcess::GuardProcess(const std::string& board_path, double tick_ms) {
  const std::string name = std::string(runtime::kDefaultHeartbeat) + "-" + std::to_string(getpid());
  pid_ = spawn({"equipoise", "guard", "--board", board_path, "--heartbeat", name, "--period-ms",
                std::to_string(tick_ms), "--parent", std::to_string(getpid())});
  for (int i = 0; i < kStartPolls; ++i) {
    int status = 0;
    if (ended(&status)) throw std::runtime_error("the guard did not come up (its reason is above)");
    try {
      if (page_ == nullptr)
        page_ = std::make_unique<runtime::SharedHeartbeat>(name, runtime::SharedHeartbeat::Role::kLoop);
      if (page_->page().guard.load(std::memory_order_acquire) != 0) return;  // it beats
    } catch (const std::runtime_error&) {                                    // not made yet
    }
    std::this_thread::sleep_for(kPoll);
  }
  stop();
  throw std::runtime_error("the guard did not come up within 5 s");
}

GuardProcess::~GuardProcess() { stop(); }

bool GuardProcess::ended(int* status) {
  if (pid_ == 0) return true;
  if (waitpid(pid_, status, WNOHANG) != pid_) return false;
  pid_ = 0;
  return true;
}

void GuardProcess::stop() {
  if (pid_ == 0) return;
  int status = 0;
  kill(pid_, SIGTERM);
  for (int i = 0; i < kEndPolls && !ended(&status); ++i) std::this_thread::sleep_for(kPoll);
  if (pid_ == 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, &status, 0);
  pid_ = 0;
}

}  // namespace equipoise::app
