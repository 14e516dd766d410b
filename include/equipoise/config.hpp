// What every robot's configuration shares. Each robot's own stands in src/robots/ROBOT/config.hpp.
// In: path, overrides -> out: typed parameters; ConfigError (file:line: key: reason and allowed range)
// otherwise. Start-up only.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace equipoise {

struct ConfigError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline const std::vector<std::string> kFidelityNames{"ideal", "thesis", "nominal", "full", "built2025"};

/// Name of the robot a file is for, without reading the rest.
std::string robot_type(const std::string& path);

/// A value of the configuration, as it was read.
struct KeyFacts {
  std::string key;      // estimator.ekf.q
  std::string value;    // as TOML
  std::string file;     // where it stands; empty: it came from --set, a board file or a calibration
  int line = 0;         // from 1
  std::string allowed;  // what reading it asks for
};

/// A configuration file that was read.
struct LoadedFile {
  std::vector<KeyFacts> keys{};  // in the order of reading
  std::string sha256;            // of the effective configuration
  std::string toml;              // the effective configuration
};
/// A robot's configuration as it was read.
template <class Config>
struct Loaded : LoadedFile {
  Config config;
};

}  // namespace equipoise
