#include "app/guard/service_notify.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace equipoise::app {
namespace {

constexpr std::int64_t kStep_us = 20000;             // how late a stop or a first tick is noticed
constexpr std::int64_t kDefaultPeriod_us = 1000000;  // ready is still said without a watchdog

/// A quarter of what the manager allows: one beat may be lost.
std::int64_t watchdog_period_us() {
  const char* const allowed = std::getenv("WATCHDOG_USEC");
  const long long value = allowed == nullptr ? 0 : std::strtoll(allowed, nullptr, 10);
  return value > 0 ? value / 4 : kDefaultPeriod_us;
}

/// Its socket; empty where there is none.
std::string service_manager() {
  const char* const name = std::getenv("NOTIFY_SOCKET");
  return name == nullptr ? "" : name;
}

}  // namespace

void notify_service_manager(const std::string& message) {
  const std::string name = service_manager();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.empty() || name.size() >= sizeof address.sun_path) return;
  std::memcpy(address.sun_path, name.data(), name.size());
  if (address.sun_path[0] == '@') address.sun_path[0] = '\0';  // abstract
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return;
  (void)sendto(fd, message.data(), message.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
               reinterpret_cast<const sockaddr*>(&address),
               static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size()));
  close(fd);
}

ServiceNotify::ServiceNotify() : period_us_(watchdog_period_us()) {
  if (!service_manager().empty()) thread_ = std::thread([this] { beat(); });
}

ServiceNotify::~ServiceNotify() {
  if (!thread_.joinable()) return;
  done_ = true;
  thread_.join();
  notify_service_manager("STOPPING=1");
}

void ServiceNotify::beat() {
  std::int64_t told = -1;
  std::int64_t waited_us = 0;
  while (!done_) {
    std::this_thread::sleep_for(std::chrono::microseconds(kStep_us));
    waited_us += kStep_us;
    const std::int64_t tick = tick_.load(std::memory_order_relaxed);
    const bool ready = told < 0 && tick >= 0;
    if (!ready && waited_us < period_us_) continue;
    waited_us = 0;
    if (tick == told) continue;  // no tick since the last beat: the manager shall notice
    notify_service_manager(ready ? "READY=1\nWATCHDOG=1" : "WATCHDOG=1");
    told = tick;
  }
}

}  // namespace equipoise::app
