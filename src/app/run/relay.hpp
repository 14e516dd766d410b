// One line that `equipoise send --live` reads: arm, disarm, heading-reset, take, or drive FORWARD LEFT YAW.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "equipoise/runtime/command_sender.hpp"

namespace equipoise::app {

struct LiveRequest {
  std::int8_t action = signed_command_t::ASK;  // ASK: take the turn that is now as one's own
  runtime::CommandSender::Motion motion{};     // of DRIVE
};

/// m/s, m/s, turns per second, within the ranges of --drive-mps and --yaw-hz; nothing for any other line.
std::optional<LiveRequest> live_request(const std::string& line);

}  // namespace equipoise::app
