// Real-time set-up of the calling thread: SCHED_FIFO, locked memory, touched stack, one CPU, no deep idle.
// In: what is wished for -> out: item by item what was obtained, and how to get the rest. Nothing is refused
// here: the caller refuses or goes on loudly (`complete()`). Undone by the destructor. Not RT-safe itself.
#pragma once

#include <sched.h>

#include <array>
#include <cstddef>
#include <string>

#include "equipoise/no_copy.hpp"

namespace equipoise::runtime {

// SCHED_FIFO: the loop above everything but the guard, which must run when the loop hangs in a spin.
inline constexpr int kLoopPriority = 80;
inline constexpr int kGuardPriority = 90;

struct RealtimeWish {
  int priority = kLoopPriority;  // 0: leave the scheduler alone
  int cpu = -1;                  // -1: wherever the kernel likes
  bool lock_memory = true;
  bool shallow_idle = true;  // hold /dev/cpu_dma_latency at 0: no slow wake-ups
  std::size_t stack_bytes = std::size_t{256} * 1024;
  std::string cpu_latency_device = "/dev/cpu_dma_latency";
};

enum RealtimeItem : std::size_t { kScheduler, kMemoryLock, kStack, kAffinity, kCpuLatency, kRealtimeItems };
inline constexpr std::array<const char*, kRealtimeItems> kRealtimeItemNames{
    "scheduler", "memory_lock", "stack", "affinity", "cpu_latency"};
/// What a user does about an item that is missing.
inline constexpr std::array<const char*, kRealtimeItems> kRealtimeRemedies{
    "run as a service with LimitRTPRIO=99, or: setcap cap_sys_nice+ep, or ulimit -r 99",
    "LimitMEMLOCK=infinity, or: setcap cap_ipc_lock+ep, or ulimit -l unlimited", "ulimit -s 8192 or more",
    "name a CPU that exists with --cpu", "a group that may write /dev/cpu_dma_latency (see the udev rule)"};

struct RealtimeResult {
  bool wanted = false;
  bool obtained = false;
  int error = 0;  // errno of what failed
};

class Realtime : NoCopy {
 public:
  explicit Realtime(const RealtimeWish& wish);
  ~Realtime();

  const std::array<RealtimeResult, kRealtimeItems>& results() const noexcept { return results_; }
  /// Everything that was wanted was obtained.
  bool complete() const noexcept;
  /// One line per missing item: name, reason, remedy. Empty when complete.
  std::string complaint() const;

 private:
  void set(RealtimeItem item, int error) noexcept;

  std::array<RealtimeResult, kRealtimeItems> results_{};
  int cpu_latency_fd_ = -1;
  cpu_set_t former_cpus_{};
  int former_policy_ = SCHED_OTHER;
  int former_priority_ = 0;
};

}  // namespace equipoise::runtime
