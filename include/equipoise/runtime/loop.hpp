// The control loop: wait, read, tick, write, hand over. In: anything that waits, reads and writes (Io), a
// pipeline, a source of commands, an observer of each tick, a stop flag -> out: why it ended. Motors are off
// on every way out. RT-safe as far as Io, source and observer are.
#pragma once

#include <atomic>
#include <cstdint>

#include "equipoise/samples.hpp"

namespace equipoise::runtime {

struct LoopEnd {
  std::int64_t ticks = 0;
  int error = 0;  // 0: stopped on request; -errno of wait_tick otherwise
};

template <class Io, class Pipeline, class Commands, class Observer>
LoopEnd run_loop(Io& io, Pipeline& pipeline, Commands&& commands, Observer&& observe,
                 const std::atomic<bool>& stop) noexcept {
  LoopEnd end;
  while (!stop.load(std::memory_order_relaxed)) {
    std::int64_t now_ns = 0;
    end.error = io.wait_tick(&now_ns);
    if (end.error != 0) break;
    const RawSample raw = io.read();
    const Command command = commands(end.ticks, now_ns);
    const auto result = pipeline.tick(raw, command);
    io.write(result.motors);
    observe(end.ticks, now_ns, raw, command, result);
    ++end.ticks;
  }
  io.motors_off();
  return end;
}

}  // namespace equipoise::runtime
