// The service manager's watchdog (systemd, sd_notify protocol): says "ready" at the first tick, then "alive"
// as long as ticks come. In: tick numbers -> out: datagrams to $NOTIFY_SOCKET from a thread of its own;
// without the variable, nothing. note() is RT-safe: one atomic store.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "equipoise/no_copy.hpp"

namespace equipoise::app {

/// One datagram to the service manager, without waiting; nothing where there is none.
void notify_service_manager(const std::string& message);

class ServiceNotify : NoCopy {
 public:
  ServiceNotify();
  ~ServiceNotify();  // says "stopping"

  void note(std::int64_t tick) noexcept { tick_.store(tick, std::memory_order_relaxed); }

 private:
  void beat();

  std::int64_t period_us_;
  std::atomic<std::int64_t> tick_{-1};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace equipoise::app
