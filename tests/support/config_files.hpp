// The configuration that a robot is tested with.
#pragma once

#include <string>

#include "app/trial/firmware.hpp"

namespace equipoise {

template <class Firmware>
std::string config_file();
template <>
inline std::string config_file<app::MbbrFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml";
}
template <>
inline std::string config_file<app::MipFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/config/edumip.toml";
}

}  // namespace equipoise
