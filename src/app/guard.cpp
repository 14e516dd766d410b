// `equipoise guard`: the process that owns the bridge enables and outlives the loop.
#include "guard.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "commands.hpp"
#include "equipoise/runtime/realtime.hpp"
#include "equipoise/runtime/supervisor.hpp"

namespace equipoise::app {
namespace {

std::atomic<bool> stopping{false};
void on_signal(int) { stopping.store(true); }

/// systemd's protocol: one datagram to the socket it names. Silent where there is no systemd.
void notify_systemd(const char* message) {
  const char* name = std::getenv("NOTIFY_SOCKET");
  if (name == nullptr || name[0] == '\0') return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(name);
  if (length >= sizeof address.sun_path) return;
  std::memcpy(address.sun_path, name, length);
  if (name[0] == '@') address.sun_path[0] = '\0';  // abstract
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return;
  (void)sendto(fd, message, std::strlen(message), MSG_DONTWAIT | MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&address),
               static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length));
  close(fd);
}

void sleep_until(std::int64_t at_ns) {
  timespec at{};
  at.tv_sec = at_ns / 1'000'000'000;
  at.tv_nsec = at_ns % 1'000'000'000;
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

}  // namespace

GuardEnd guard_loop(const GuardOptions& options, Bridges& bridges, runtime::HeartbeatPage& page,
                    const std::atomic<bool>& stop) {
  GuardEnd end;
  runtime::BeatWatch loop(options.silent_ticks * options.period_ns);
  bool on = false;
  end.error = bridges.off();
  const std::int64_t poll_ns = options.period_ns / 2;
  std::int64_t due_ns = runtime::monotonic_now_ns();
  std::int64_t next_watchdog_ns = 0;
  while (!stop.load(std::memory_order_relaxed)) {
    due_ns += poll_ns;
    sleep_until(due_ns);
    const std::int64_t now_ns = runtime::monotonic_now_ns();
    if (now_ns - due_ns > options.period_ns) due_ns = now_ns;  // late ourselves: no burst of polls
    page.guard.fetch_add(1, std::memory_order_release);
    const bool alive = loop.alive(page.loop.load(std::memory_order_acquire), now_ns);
    if (alive && !on) {
      const int error = bridges.enable();
      on = error == 0;
      if (error != 0) end.error = error;
    } else if (!alive && on) {
      const int error = bridges.off();
      if (error != 0) end.error = error;
      on = false;
      ++end.cuts;
      end.last_cut_ns = runtime::monotonic_now_ns();
      page.cut.fetch_add(1, std::memory_order_release);
    } else if (!alive) {
      (void)bridges.off();  // a stopped loop that wakes up may still write one old duty
    }
    if (now_ns >= next_watchdog_ns) {
      notify_systemd("WATCHDOG=1");
      next_watchdog_ns = now_ns + options.watchdog_ns;
    }
  }
  const int error = bridges.off();
  if (error != 0) end.error = error;
  return end;
}

namespace {

struct Arguments {
  std::string heartbeat = runtime::kDefaultHeartbeat;
  std::string enable;
  std::vector<std::string> pwm;
  double period_ms = 5.0;
  int silent_ticks = 2;
  int priority = 90;
};

int run(const Arguments& a) {
  FileBridges bridges(a.enable, a.pwm);
  runtime::SharedHeartbeat heartbeat(a.heartbeat, runtime::SharedHeartbeat::Role::kGuard);
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  runtime::RealtimeWish wish;
  wish.priority = a.priority;
  wish.shallow_idle = false;  // the loop holds it
  const runtime::Realtime realtime(wish);
  if (!realtime.complete()) {
    std::fprintf(stderr, "equipoise: warning: guard without full real time:\n%s\n",
                 realtime.complaint().c_str());
  }
  GuardOptions options;
  options.period_ns = static_cast<std::int64_t>(a.period_ms * 1e6);
  options.silent_ticks = a.silent_ticks;
  notify_systemd("READY=1");
  const GuardEnd end = guard_loop(options, bridges, heartbeat.page(), stopping);
  notify_systemd("STOPPING=1");
  if (end.error != 0) {
    std::fprintf(stderr, "equipoise: guard: a bridge could not be switched: %s\n", std::strerror(-end.error));
    return 1;
  }
  return 0;
}

}  // namespace

void add_guard(CLI::App& app, int* status) {
  auto* command = app.add_subcommand("guard", "stop the motors when the loop is dead, stopped or hanging");
  auto a = std::make_shared<Arguments>();
  command->add_option("--heartbeat", a->heartbeat, "shared-memory name")->capture_default_str();
  command->add_option("--enable", a->enable, "value file of the bridge enable line: 1 awake, 0 asleep");
  command->add_option("--pwm", a->pwm, "duty_cycle file of each motor's PWM channel")->required();
  command->add_option("--period-ms", a->period_ms, "the loop's tick")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 100.0));
  command->add_option("--silent-ticks", a->silent_ticks, "ticks without a beat until the motors stop")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  command->add_option("--priority", a->priority, "SCHED_FIFO priority, above the loop's; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0, 99));
  command->callback([=] { *status = run(*a); });
}

}  // namespace equipoise::app
