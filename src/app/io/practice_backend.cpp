#include "app/io/practice_backend.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>

#include "app/text/errors.hpp"

namespace equipoise::app {
namespace {

/// Reads a number at the front of `text` and cuts it off.
double seconds(std::string* text) {
  char* end = nullptr;
  const double value = std::strtod(text->c_str(), &end);
  const bool read = end != text->c_str() && std::isfinite(value) && value >= 0.0 && value <= 1e6;
  text->erase(0, static_cast<std::size_t>(end - text->c_str()));
  return read ? value : -1.0;
}

}  // namespace

PlannedFault planned_fault(const std::string& text) {
  const std::size_t at = text.find('@');
  const std::string name = text.substr(0, at);
  std::string names;
  PlannedFault fault;
  bool known = false;
  for (std::size_t i = 0; i < kFaults.size(); ++i) {
    const auto kind = static_cast<FaultKind>(i);
    if (kind == FaultKind::kRemoteLost) continue;  // the sender is outside: stop it
    if (name == kFaults[i].name) {
      fault.kind = kind;
      known = true;
    }
    names += (names.empty() ? "" : ", ") + std::string(kFaults[i].name);
  }
  if (!known) throw InputError("--fault " + text + ": no such fault; there are: " + names);
  const InputError wrong("--fault " + text + ": expected NAME@T or NAME@T+D in seconds, e.g. count_jump@5");
  if (at == std::string::npos) throw wrong;
  std::string times = text.substr(at + 1);
  fault.at_s = seconds(&times);
  double lasts_s = std::numeric_limits<double>::infinity();
  if (!times.empty() && times.front() == '+') {
    times.erase(0, 1);
    lasts_s = seconds(&times);
  }
  if (fault.at_s < 0.0 || lasts_s < 0.0 || !times.empty()) throw wrong;
  fault.ticks = static_cast<int>(std::min(std::ceil(lasts_s * kTickHz), 1e9));
  return fault;
}

}  // namespace equipoise::app
