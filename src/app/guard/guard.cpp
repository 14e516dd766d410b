// `equipoise guard`: the process that owns the bridge enables and outlives the loop.
#include "app/guard/guard.hpp"

#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>

#include "app/board/board.hpp"
#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/guard/service_notify.hpp"
#include "equipoise/runtime/monotonic.hpp"
#include "equipoise/runtime/realtime.hpp"

namespace equipoise::app {
GuardEnd guard_loop(const GuardOptions& options, Bridges& bridges, runtime::HeartbeatPage& page,
                    const std::atomic<bool>& stop) {
  GuardEnd end;
  const std::int64_t limit_ns = options.silent_ticks * options.period_ns + options.period_ns / 4;
  bool on = false;
  end.error = bridges.off();
  std::int64_t next_watchdog_ns = 0;
  while (!stop.load(std::memory_order_relaxed)) {
    const std::int64_t beat_ns = page.loop_ns.load(std::memory_order_acquire);  // before the clock is read
    const std::int64_t now_ns = runtime::monotonic_now_ns();
    const std::int64_t silent_ns = now_ns - beat_ns;
    const bool alive = silent_ns >= 0 && silent_ns <= limit_ns;
    const bool asked = page.want_enable.load(std::memory_order_relaxed) != 0;
    // Once the loop has let go it means what it asks for.
    const bool answered =
        page.answered.load(std::memory_order_relaxed) == page.cut.load(std::memory_order_relaxed);
    const bool wanted = alive && asked && answered;
    if (wanted && !on) {
      const int error = bridges.enable();
      on = error == 0;
      if (error != 0) end.error = error;
    } else if (!wanted && on) {
      const int error = bridges.off();
      if (error != 0) end.error = error;
      on = false;
      if (!alive) {
        ++end.cuts;
        page.cut_ns.store(runtime::monotonic_now_ns(), std::memory_order_relaxed);
        page.cut.fetch_add(1, std::memory_order_release);
      }
    } else if (!alive || !answered) {
      (void)bridges.off();  // a stopped loop that wakes up may still write an old duty
    }
    if (now_ns >= next_watchdog_ns) {
      notify_service_manager("WATCHDOG=1");
      next_watchdog_ns = now_ns + options.watchdog_ns;
    }
    page.guard_ns.store(now_ns, std::memory_order_release);
    // A loop that drives and falls silent is cut at the limit, not at the next look.
    runtime::sleep_until(on ? std::min(now_ns + 2 * options.period_ns, beat_ns + limit_ns + 1)
                            : now_ns + options.period_ns);
  }
  const int error = bridges.off();
  if (error != 0) end.error = error;
  return end;
}

namespace {

struct GuardArguments {
  int heartbeat_fd = -1;
  std::string board;
  std::string enable;
  std::vector<std::string> pwm;
  double period_ms = 5.0;
  int silent_ticks = 2;
  int priority = runtime::kGuardPriority;
  int parent = 0;
  int complain_fd = STDERR_FILENO;
};

std::unique_ptr<Bridges> bridges_of(const GuardArguments& a) {
  if (a.board.empty() == a.pwm.empty())
    throw InputError("guard needs either --board FILE or --pwm FILE...: what shall it switch off?");
  if (a.board.empty()) return std::make_unique<FileBridges>(a.enable, a.pwm);
  return std::make_unique<BoardBridges>(load_wiring(a.board).wiring);
}

/// The kernel tells us when the loop's thread has ended, so that no guard outlives its robot's process.
bool follow(int parent) {
  if (prctl(PR_SET_PDEATHSIG, SIGTERM) != 0) return false;
  return getppid() == parent;  // it may have ended before we asked
}

int run(const GuardArguments& a) {
  watch_interrupts();
  std::unique_ptr<Bridges> bridges;
  std::unique_ptr<runtime::SharedHeartbeat> heartbeat;
  try {
    bridges = bridges_of(a);
    heartbeat = std::make_unique<runtime::SharedHeartbeat>(a.heartbeat_fd);
  } catch (const std::runtime_error& error) {
    if (a.complain_fd == STDERR_FILENO) throw;
    (void)!write(a.complain_fd, error.what(), std::strlen(error.what()));
    return 1;
  }
  if (a.parent != 0 && !follow(a.parent)) return 0;
  runtime::RealtimeWish wish;
  wish.priority = a.priority;
  wish.shallow_idle = false;  // the loop holds it
  const runtime::Realtime realtime(wish);
  if (!realtime.complete() && a.parent == 0) {  // a parent has said it already
    std::fprintf(stderr, "equipoise: warning: guard without full real time:\n%s\n",
                 realtime.complaint().c_str());
  }
  GuardOptions options;
  options.period_ns = static_cast<std::int64_t>(a.period_ms * 1e6);
  options.silent_ticks = a.silent_ticks;
  notify_service_manager("READY=1");
  const GuardEnd end = guard_loop(options, *bridges, heartbeat->page(), interrupted);
  notify_service_manager("STOPPING=1");
  if (end.error != 0) {
    std::fprintf(stderr, "equipoise: guard: a bridge could not be switched: %s\n", std::strerror(-end.error));
    return 1;
  }
  return 0;
}

}  // namespace

void add_guard(Subcommand app) {
  const Subcommand command =
      app.subcommand("guard", "Stops the motors when the loop is dead, stopped or hanging")
          .example("equipoise guard --heartbeat-fd 3 --board board.toml");
  auto a = std::make_shared<GuardArguments>();
  command.option("--heartbeat-fd", a->heartbeat_fd, "descriptor of the page on which the loop beats")
      .required();
  command.option("--board", a->board, "wiring, TOML: the bridges to hold; see config/boards").file();
  command.option("--enable", a->enable, "value file of the bridge enable line: 1 awake, 0 asleep");
  command.option("--pwm", a->pwm, "duty_cycle file of each motor's PWM channel, instead of --board");
  command.option("--period-ms", a->period_ms, "the loop's tick").show_default().range(0.5, 1000.0);
  command.option("--silent-ticks", a->silent_ticks, "ticks without a beat until the motors stop")
      .show_default()
      .range(1, 100);
  command.option("--priority", a->priority, "SCHED_FIFO priority, above the loop's; 0: none")
      .show_default()
      .range(0, 99);
  command.option("--parent", a->parent, "end with this process, whose child this is (run starts its own)");
  command.option("--complain-fd", a->complain_fd, "where to say why it cannot start (run passes a pipe)");
  command.action([=] { return run(*a); });
}

}  // namespace equipoise::app
