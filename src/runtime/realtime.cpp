#include "equipoise/runtime/realtime.hpp"

#include <alloca.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace equipoise::runtime {
namespace {

constexpr std::size_t kPage = 4096;
constexpr std::size_t kStackReserve = std::size_t{64} * 1024;  // what is in use already, and the guard page

/// Touches the pages that the loop's calls will use, so that none is faulted in later.
[[gnu::noinline]] void touch_stack(std::size_t bytes) {
  // cppcheck-suppress allocaCalled  ; the stack itself is meant
  auto* block = static_cast<volatile unsigned char*>(alloca(bytes));
  for (std::size_t at = 0; at < bytes; at += kPage) block[at] = 1;
}

int fault_in_stack(std::size_t bytes) {
  pthread_attr_t attributes;
  int error = pthread_getattr_np(pthread_self(), &attributes);
  if (error != 0) return error;
  std::size_t size = 0;
  void* lowest = nullptr;
  error = pthread_attr_getstack(&attributes, &lowest, &size);
  pthread_attr_destroy(&attributes);
  if (error != 0) return error;
  if (size < bytes + kStackReserve) return ENOMEM;
  touch_stack(bytes);
  return 0;
}

int lock_memory() {
  // Freed blocks stay with the process: giving them back would fault them in again.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

int pin_to(int cpu) {
  if (cpu >= CPU_SETSIZE) return EINVAL;
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  CPU_SET(static_cast<unsigned>(cpu), &cpus);
  return pthread_setaffinity_np(pthread_self(), sizeof cpus, &cpus);
}

}  // namespace

void Realtime::set(RealtimeItem item, int error) noexcept { results_[item] = {true, error == 0, error}; }

Realtime::Realtime(const RealtimeWish& wish) {
  sched_param former{};
  pthread_getschedparam(pthread_self(), &former_policy_, &former);
  former_priority_ = former.sched_priority;
  pthread_getaffinity_np(pthread_self(), sizeof former_cpus_, &former_cpus_);

  if (wish.lock_memory) set(kMemoryLock, lock_memory());
  if (wish.stack_bytes > 0) set(kStack, fault_in_stack(wish.stack_bytes));
  if (wish.cpu >= 0) set(kAffinity, pin_to(wish.cpu));
  if (wish.shallow_idle) {
    // The wish holds as long as the file is open.
    cpu_latency_fd_ = open(wish.cpu_latency_device.c_str(), O_WRONLY | O_CLOEXEC);
    const std::int32_t microseconds = 0;
    const bool held = cpu_latency_fd_ >= 0 &&
                      write(cpu_latency_fd_, &microseconds, sizeof microseconds) == sizeof microseconds;
    // Without the device the kernel has no idle states to forbid.
    if (held || errno != ENOENT) set(kCpuLatency, held ? 0 : errno);
  }
  if (wish.priority > 0) {
    sched_param scheduling{};
    scheduling.sched_priority = wish.priority;
    set(kScheduler, pthread_setschedparam(pthread_self(), SCHED_FIFO, &scheduling));
  }
}

Realtime::~Realtime() {
  sched_param former{};
  former.sched_priority = former_priority_;
  if (results_[kScheduler].obtained) pthread_setschedparam(pthread_self(), former_policy_, &former);
  if (results_[kAffinity].obtained)
    pthread_setaffinity_np(pthread_self(), sizeof former_cpus_, &former_cpus_);
  if (results_[kMemoryLock].obtained) munlockall();
  if (cpu_latency_fd_ >= 0) close(cpu_latency_fd_);
}

bool Realtime::complete() const noexcept {
  return std::all_of(results_.begin(), results_.end(),
                     [](const RealtimeResult& r) { return r.obtained || !r.wanted; });
}

std::string Realtime::complaint() const {
  std::string text;
  for (std::size_t i = 0; i < kRealtimeItems; ++i) {
    if (results_[i].obtained || !results_[i].wanted) continue;
    text += std::string(text.empty() ? "" : "\n") + kRealtimeItemNames[i] +
            " not obtained: " + std::strerror(results_[i].error) + "; " + kRealtimeRemedies[i];
  }
  return text;
}

}  // namespace equipoise::runtime
