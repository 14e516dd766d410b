// Gains of a configuration, and the margins of the loop with filter and delays in it, over the yaw rate: one
// place for the command line and the Python package. In: request -> out: JSON. Start-up only.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "app/text/json.hpp"

namespace equipoise::app {

struct DesignRequest {
  std::string config;  // a file
  std::vector<std::string> set;
  std::string estimator;   // empty: ekf
  std::string controller;  // empty: the robot's default
  double last_hz = 3.0;
  double step_hz = 0.5;
  bool bode = false;                          // with the frequency responses
  std::function<void(double)> progress = {};  // share done; may be empty
};

/// Where the loop is broken for its margins.
inline constexpr std::array<const char*, 3> kBrokenAt{"u", "gyro", "encoder"};

/// ConfigError for a robot without a design, or an unknown estimator or controller.
nlohmann::json design(const DesignRequest& request);

}  // namespace equipoise::app
