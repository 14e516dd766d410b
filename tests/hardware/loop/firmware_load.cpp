// How many instructions the whole firmware takes while it balances a robot of the emulated board: `equipoise
// run` as the service starts it, with guard, log and telemetry, and the kernel's part. The emulated machine's
// clock counts one instruction per ns, so that the kernel's own account of who ran how long is the count. Per
// robot one line of JSON: instructions per tick of the loop's thread, of the firmware's other threads, of the
// guard, and of the kernel beside them; the simulated robot is left out.
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>

#include "closed_loop.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace {

namespace fs = std::filesystem;

constexpr int kTicksPerSecond = 200;
constexpr int kToStart = 60 * kTicksPerSecond;
constexpr int kToSettle = 3 * kTicksPerSecond;
constexpr int kCounted = 20 * kTicksPerSecond;
constexpr double kNsPerClockTick = 1e7;

struct Task {
  pid_t process = 0;
  double ran_ns = 0.0;
};

struct Account {
  double now_ns = 0.0;
  double idle_ns = 0.0;
  std::map<pid_t, Task> tasks;  // every thread of the machine
};

Account account() {
  Account a;
  for (const auto& process : fs::directory_iterator("/proc")) {
    const std::string pid = process.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    std::error_code ended;
    for (const auto& task : fs::directory_iterator(process.path() / "task", ended)) {
      Task t;
      t.process = std::stoi(pid);
      if (std::ifstream(task.path() / "schedstat") >> t.ran_ns)
        a.tasks[std::stoi(task.path().filename())] = t;
    }
  }
  std::ifstream stat("/proc/stat");
  std::string cpu;
  double user = 0.0, nice = 0.0, system = 0.0, idle = 0.0;
  stat >> cpu >> user >> nice >> system >> idle;
  a.idle_ns = idle * kNsPerClockTick;
  a.now_ns = static_cast<double>(equipoise::runtime::monotonic_now_ns());
  return a;
}

pid_t parent_of(pid_t pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  std::getline(stat, line);
  std::istringstream rest(line.substr(std::min(line.size(), line.rfind(')') + 1)));
  char state = 0;
  pid_t parent = 0;
  rest >> state >> parent;
  return parent;
}

/// Per tick; `firmware`: its process, 0 while there is none.
nlohmann::json between(const Account& from, const Account& to, pid_t firmware) {
  double loop = 0.0, others = 0.0, guard = 0.0, world = 0.0, kernel = 0.0;
  for (const auto& [id, task] : to.tasks) {
    const auto before = from.tasks.find(id);
    const double ran = task.ran_ns - (before == from.tasks.end() ? 0.0 : before->second.ran_ns);
    double& share = task.process == getpid()                               ? world
                    : firmware != 0 && id == firmware                      ? loop
                    : firmware != 0 && task.process == firmware            ? others
                    : firmware != 0 && parent_of(task.process) == firmware ? guard
                                                                           : kernel;
    share += ran;
  }
  const double busy = (to.now_ns - from.now_ns) - (to.idle_ns - from.idle_ns);
  kernel = busy - loop - others - guard - world;  // and what interrupts took while nobody ran
  return {{"loop", loop / kCounted},
          {"threads", others / kCounted},
          {"guard", guard / kCounted},
          {"kernel", kernel / kCounted}};
}

void advance(PinWorld* world, int ticks) {
  for (int i = 0; i < ticks; ++i) world->advance();
}

pid_t start(const PinRobot& robot) {
  const pid_t child = fork();
  if (child != 0) return child;
  const std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "../../equipoise";
  execl(program.c_str(), "equipoise", "run", "--config", robot.config.c_str(), "--board", robot.board.c_str(),
        "--arm", "--without-calibration", "--log", "/tmp/run.lcm", nullptr);
  _exit(127);
}

/// As packaging/real-time-machine does, for which this machine has no chrt.
void raise_interrupt_line() {
  sched_param priority{};
  priority.sched_priority = 85;
  for (const auto& process : fs::directory_iterator("/proc")) {
    std::string comm;
    std::getline(std::ifstream(process.path() / "comm"), comm);
    if (comm.rfind("irq/", 0) != 0 || comm.find("-equipoise") == std::string::npos) continue;
    if (sched_setscheduler(std::stoi(process.path().filename()), SCHED_FIFO, &priority) == 0) return;
  }
  throw std::runtime_error("no interrupt thread of our line");
}

nlohmann::json load(const PinRobot& robot) {
  Bench bench;
  PinWorld world(bench, robot, 1);
  advance(&world, kToSettle);
  const Account before = account();
  advance(&world, kCounted);
  const nlohmann::json alone = between(before, account(), 0);

  const pid_t firmware = start(robot);
  for (int i = 0; i < kToStart && world.held(); ++i) world.advance();
  raise_interrupt_line();
  advance(&world, kToSettle);
  const Account begun = account();
  advance(&world, kCounted);
  nlohmann::json counted = between(begun, account(), firmware);
  if (world.held() || world.motorsOff() || world.tilt_rad() > 0.5 || waitpid(firmware, nullptr, WNOHANG) != 0)
    throw std::runtime_error(std::string(robot.name) + " did not balance");
  kill(firmware, SIGTERM);
  for (int i = 0; i < 2 * kTicksPerSecond && waitpid(-1, nullptr, WNOHANG) >= 0; ++i) world.advance();
  counted["kernel"] = counted["kernel"].get<double>() - alone["kernel"].get<double>();
  return counted;
}

}  // namespace

int main() {
  // The world does not wait for anybody: above guard and loop.
  sched_param priority{};
  priority.sched_priority = 95;
  if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority) != 0 ||
      mlockall(MCL_CURRENT | MCL_FUTURE) != 0 || prctl(PR_SET_CHILD_SUBREAPER, 1) != 0) {
    std::perror("firmware_load");
    return 1;
  }
  for (const auto& [name, robot] : {std::pair{"mbbr", PinRobot::mbbr()}, {"mip", PinRobot::edumip()}}) {
    try {
      std::cout << nlohmann::json{{"load", name}, {"instructions", load(robot)}} << std::endl;
    } catch (const std::exception& problem) {
      std::cout << "VM: no load: " << problem.what() << std::endl;
      return 1;
    }
  }
  return 0;
}
