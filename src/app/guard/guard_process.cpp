#include "app/guard/guard_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
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

constexpr int kComplaints = 3;  // the child's file descriptors
constexpr int kHeartbeat = 4;

/// What the guard said before it ended.
std::string text_of(int fd) {
  std::array<char, 512> text{};
  const ssize_t size = read(fd, text.data(), text.size());
  return size > 0 ? std::string(text.data(), static_cast<std::size_t>(size))
                  : "the guard ended without a word";
}

/// Both ends closed at the end, and in every child but by its own number.
struct Pipe : NoCopy {
  Pipe() {
    if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
      throw std::runtime_error(std::string("no pipe for the guard: ") + std::strerror(errno));
  }
  ~Pipe() {
    for (const int fd : ends) close(fd);
  }
  std::array<int, 2> ends{};
};

pid_t spawn(std::vector<std::string> arguments, int complaints, int heartbeat) {
  std::vector<char*> argv(arguments.size());
  std::transform(arguments.begin(), arguments.end(), argv.begin(), [](std::string& a) { return a.data(); });
  argv.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // A group of its own: Ctrl-C in the terminal is for the loop, which then stops the guard.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  // Both far up first: one's number may be the other's place.
  constexpr int kOutOfTheWay = 100;
  posix_spawn_file_actions_adddup2(&files, complaints, kOutOfTheWay + kComplaints);
  posix_spawn_file_actions_adddup2(&files, heartbeat, kOutOfTheWay + kHeartbeat);
  for (const int fd : {kComplaints, kHeartbeat}) {
    posix_spawn_file_actions_adddup2(&files, kOutOfTheWay + fd, fd);
    posix_spawn_file_actions_addclose(&files, kOutOfTheWay + fd);
  }
  pid_t pid = 0;
  const int error =
      posix_spawn(&pid, "/proc/self/exe", &files, &attributes, argv.data(), environment().data());
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (error != 0)
    throw std::runtime_error(std::string("the guard cannot be started: ") + std::strerror(error));
  return pid;
}

}  // namespace

GuardProcess::GuardProcess(const std::string& board_path) {
  const Pipe complaints;
  pid_ = spawn({"equipoise", "guard", "--board", board_path, "--heartbeat-fd", std::to_string(kHeartbeat),
                "--parent", std::to_string(getpid()), "--complain-fd", std::to_string(kComplaints)},
               complaints.ends[1], heartbeat_.fd());
  for (int i = 0; i < kStartPolls; ++i) {
    int status = 0;
    if (ended(&status)) {
      std::string what = board_path;
      what.append(": ").append(text_of(complaints.ends[0]));
      throw std::runtime_error(
          what.append(" (equipoise doctor --board ").append(board_path).append(" finds the cause)"));
    }
    if (page().guard_ns.load(std::memory_order_acquire) != 0) return;  // it beats
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
