// A board file's text with its wiring corrected, comments kept. In: text, what the wheels did -> out: text in
// which motor i turns wheel i forwards and encoder i counts it up. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "app/commission/calibrate_wheels.hpp"

namespace equipoise::app {

std::string rewired(const std::string& text, const std::vector<WheelFinding>& findings);
/// With [board] calibration = `file`.
std::string with_calibration(const std::string& text, const std::string& file);

}  // namespace equipoise::app
