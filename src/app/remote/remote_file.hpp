// A remote in a hand as a file (config/remotes/*.toml): which device, what its controls do, how fast full is.
// In: path -> out: RemoteFile; ConfigError (file:line: key: reason and what is allowed). Start-up only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/remote/hand.hpp"

namespace equipoise::app {

/// A key or button, or an axis that is pushed one way.
struct EventBinding {
  HandAction action{};
  bool axis = false;
  std::uint16_t code = 0;
  double sign = 1.0;
};

struct FrameBinding {
  HandAction action{};
  std::string bytes;
};

struct RemoteFile {
  enum class Kind { kEvents, kFrames };
  Kind kind = Kind::kEvents;
  std::string device;  // path, or a serial port's address
  double speed_m_s = 0.0;
  double turn_hz = 0.0;
  std::vector<EventBinding> events;
  std::optional<std::pair<int, int>> axis_range;  // of a device that does not say it
  double hold_s = 0.5;  // how long a button lasts after its frame; a stick without any event
  int baud = 9600;
  std::vector<FrameBinding> frames;
};

RemoteFile load_remote(const std::string& path);
/// From text; `origin` names it in errors.
RemoteFile parse_remote(const std::string& text, const std::string& origin);

/// Why these frames cannot be told apart; empty: they can.
std::string confusion(const std::vector<FrameBinding>& frames);
std::string to_hex(const std::string& bytes);

}  // namespace equipoise::app
