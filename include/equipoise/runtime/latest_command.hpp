// The newest command and its age, as the tick takes it. In: commands whenever one comes -> out: per tick, the
// newest with age_s since it came (before the first: since the first tick). What follows from the age is the
// safety's business: safety.command_timeout_s is the only limit. RT-safe.
#pragma once

#include "equipoise/samples.hpp"

namespace equipoise::runtime {

class LatestCommand {
 public:
  void renew(const Command& command, std::int64_t now_ns) noexcept {
    const bool reset = command_.heading_reset || command.heading_reset;  // none of several is lost
    command_ = command;
    command_.heading_reset = reset;
    came_ns_ = now_ns;
    known_ = true;
  }

  /// Once per tick.
  Command at(std::int64_t now_ns) noexcept {
    if (!known_) renew(command_, now_ns);
    Command command = command_;
    command.age_s = 1e-9 * static_cast<double>(now_ns - came_ns_);
    command_.heading_reset = false;  // once per command
    return command;
  }

 private:
  Command command_;
  std::int64_t came_ns_ = 0;
  bool known_ = false;
};

}  // namespace equipoise::runtime
