// Checks of a foreign table by itself: rows, clock, gaps, repeats, clipping, jumps, norm of the
// accelerometer. In: table, rows -> out: verdicts; and how near a factor is to one, or to a mistake of units.
// Not RT-safe.
#pragma once

#include <utility>
#include <vector>

#include "app/import/checks.hpp"

namespace equipoise::app {

/// Which mistake of units makes a factor between two; empty: none that is known.
std::string units_mistake(double least, double most,
                          const std::vector<std::pair<double, const char*>>& known);

constexpr double kRight = 1.4;  // so far off may be a radius, a track, an accelerometer's scale

std::vector<Check> check_table(const Table& table, const ImportedRows& rows, const ImportMap& map,
                               const ImportedRobot& robot);

}  // namespace equipoise::app
