// What a thread asks of the kernel, and when it sleeps, from the kernel's own trace (tracefs: raw_syscalls,
// sched_switch). As root, in the test machine only.
#pragma once

#include <sys/types.h>

#include <map>
#include <set>
#include <string>
#include <vector>

/// One tick of the loop: from the return of the call that waits for the data-ready edge to the next such
/// call.
struct TracedTick {
  std::map<int, int> calls;  // number of the system call -> how often
  int sleeps = 0;            // times the thread gave the processor away because it had to wait
  int sum() const;
};

class SyscallTrace {
 public:
  explicit SyscallTrace(pid_t thread);  // prepares; takes longer than a tick
  ~SyscallTrace();
  void begin();
  void end();
  /// Between begin and end, whole ticks only; `waiting`: numbers of the calls that wait for the edge.
  std::vector<TracedTick> ticks(const std::set<int>& waiting) const;

 private:
  pid_t thread_;
};
