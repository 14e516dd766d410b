// What came of one trial of a real or external robot.
#pragma once

#include <cstdint>

#include "app/trial/verdict.hpp"
#include "equipoise/types.hpp"

namespace equipoise::app {

struct Trial {
  Verdict verdict;
  std::int64_t ticks = 0;
  int error = 0;       // -errno that ended the ticks; -ESHUTDOWN: the backend had no more
  bool armed = false;  // at least once
  double duty_max = 0.0;
  std::int64_t driven = 0;
  std::int64_t saturated = 0;

  double duration_s() const { return static_cast<double>(ticks) * kTickS; }
};

}  // namespace equipoise::app
