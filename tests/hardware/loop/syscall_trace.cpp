#include "syscall_trace.hpp"

#include <gtest/gtest.h>
#include <sys/mount.h>

#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>

namespace {
const std::string kTracing = "/sys/kernel/tracing/";
constexpr const char* kEvents[] = {"raw_syscalls/sys_enter", "raw_syscalls/sys_exit", "sched/sched_switch"};

void set(const std::string& file, const std::string& value) {
  std::ofstream out(kTracing + file);
  out << value << std::flush;
  EXPECT_TRUE(out.good()) << file << ": " << value;
}

void switchEvents(bool on) {
  for (const char* event : kEvents) set(std::string("events/") + event + "/enable", on ? "1" : "0");
}

/// Of "NR 180 (7, ...)" or "NR 180 = 4".
int callOf(const std::string& line) {
  const std::size_t at = line.find(" NR ");
  return at == std::string::npos ? -1 : std::stoi(line.substr(at + 4));
}
}  // namespace

int TracedTick::sum() const {
  int sum = 0;
  for (const auto& [call, times] : calls) sum += times;
  return sum;
}

SyscallTrace::SyscallTrace(pid_t thread) : thread_(thread) {
  mount("tracefs", kTracing.c_str(), "tracefs", 0, nullptr);
  set("tracing_on", "0");
  set("buffer_size_kb", "8192");
  set("trace", "");
  set("set_event_pid", std::to_string(thread));
  switchEvents(true);
}

void SyscallTrace::begin() { set("tracing_on", "1"); }

SyscallTrace::~SyscallTrace() { switchEvents(false); }

void SyscallTrace::end() { set("tracing_on", "0"); }

std::vector<TracedTick> SyscallTrace::ticks(const std::set<int>& waiting) const {
  std::vector<TracedTick> ticks;
  std::optional<TracedTick> tick;
  const std::string sleeping = "prev_pid=" + std::to_string(thread_) + " ";
  std::ifstream trace(kTracing + "trace");
  for (std::string line; std::getline(trace, line);) {
    if (line.find("sys_exit: NR") != std::string::npos && waiting.count(callOf(line)) != 0) {
      tick.emplace();
    } else if (line.find("sys_enter: NR") != std::string::npos && tick) {
      if (waiting.count(callOf(line)) != 0) {
        ticks.push_back(*tick);
        tick.reset();
      } else {
        ++tick->calls[callOf(line)];
      }
    } else if (tick && line.find(sleeping) != std::string::npos) {
      // R, R+: it was preempted.
      if (line.find("prev_state=R") == std::string::npos) ++tick->sleeps;
    }
  }
  return ticks;
}
