// Is a foreign log what its map says? In: rows, ticks -> out: a verdict per check: right, wrong and what the
// likely mistake is, or not to be told from this log. Units, flipped axes and swapped wheels show where two
// sensors must agree: least squares of one on the other, between 0.5 and 5 Hz. Not RT-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/import/import.hpp"

namespace equipoise::app {

struct Check {
  std::string name;
  std::optional<bool> ok;  // none: this log does not tell
  double value = kNotGiven;
  std::string text;
};

std::vector<Check> check_import(const Table& table, const ImportedRows& rows, const ImportMap& map,
                                const ImportedRobot& robot);

}  // namespace equipoise::app
