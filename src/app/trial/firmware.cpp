#include "app/trial/firmware.hpp"

namespace equipoise::app {

namespace {

/// "mbbr: a, b; mip: c, d".
template <class NamesOf>
std::string per_robot(NamesOf&& names_of) {
  std::string text;
  for_each_robot([&](auto firmware) {
    text += (text.empty() ? "" : "; ") + std::string(firmware.kName) + ":";
    bool first = true;
    for (const std::string& name : names_of(firmware)) {
      text += (first ? " " : ", ") + name;
      first = false;
    }
  });
  return text;
}

}  // namespace

std::string known_estimators() {
  return per_robot([](auto firmware) { return firmware.estimators(); });
}
std::string known_controllers() {
  return per_robot([](auto firmware) { return firmware.controllers(); });
}

}  // namespace equipoise::app
