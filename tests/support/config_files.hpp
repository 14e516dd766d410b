// The robot type, and the configuration that it is tested with.
#pragma once

#include <string>

#include "app/trial/firmware.hpp"
#include "robots/robot_list.hpp"

namespace equipoise {

template <class Firmware>
const app::RobotType& type_of() {
  return app::robot_type_of(Firmware::kName, "the test");
}

template <class Firmware>
std::string config_file();
template <>
inline std::string config_file<MbbrFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
}
template <>
inline std::string config_file<MipFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml";
}

}  // namespace equipoise
