// The control loop: wait, read, tick, write, hand over. In: anything that waits, reads and writes (Io), a
// pipeline, a source of commands, an observer of each tick, a stop flag, and who watches over the loop
// (supervisor.hpp on the robot) -> out: why it ended. Motors are off on every way out. RT-safe as far as Io,
// source, observer and supervisor are.
#pragma once

#include <atomic>
#include <cstdint>

#include "equipoise/samples.hpp"

namespace equipoise::runtime {

struct LoopEnd {
  std::int64_t ticks = 0;
  int error = 0;  // 0: stopped on request; -errno of wait_tick otherwise
};

/// Nobody watches: simulated time has no deadlines.
struct NoSupervisor {
  /// SafetyReason bits that forbid motors in this tick.
  std::uint32_t begin(std::int64_t /*now_ns*/, const RawSample& /*raw*/) noexcept { return 0; }
  /// `driven`: motors are to run; `write_error`: what writing them returned.
  void end(bool /*driven*/, int /*write_error*/) noexcept {}
};

/// One turn of the loop; false, with end->error, when the wait failed.
template <class Io, class Pipeline, class Commands, class Observer, class Supervisor>
bool run_tick(Io& io, Pipeline& pipeline, Commands&& commands, Observer&& observe, Supervisor& supervisor,
              LoopEnd* end) noexcept {
  std::int64_t now_ns = 0;
  end->error = io.wait_tick(&now_ns);
  if (end->error != 0) return false;
  const RawSample raw = io.read();
  const std::uint32_t inhibit = supervisor.begin(now_ns, raw);
  const Command command = commands(end->ticks, now_ns);
  const auto result = pipeline.tick(raw, command, {now_ns, inhibit});
  supervisor.end(result.motors.enable, io.write(result.motors));
  observe(end->ticks, now_ns, raw, command, result);
  ++end->ticks;
  return true;
}

template <class Io, class Pipeline, class Commands, class Observer, class Supervisor>
LoopEnd run_loop(Io& io, Pipeline& pipeline, Commands&& commands, Observer&& observe,
                 const std::atomic<bool>& stop, Supervisor& supervisor) noexcept {
  LoopEnd end;
  while (!stop.load(std::memory_order_relaxed) &&
         run_tick(io, pipeline, commands, observe, supervisor, &end)) {
  }
  supervisor.end(false, io.motors_off());  // the guard need not wait for our silence
  return end;
}

template <class Io, class Pipeline, class Commands, class Observer>
LoopEnd run_loop(Io& io, Pipeline& pipeline, Commands&& commands, Observer&& observe,
                 const std::atomic<bool>& stop) noexcept {
  NoSupervisor nobody;
  return run_loop(io, pipeline, commands, observe, stop, nobody);
}

}  // namespace equipoise::runtime
