// From what came while one button was held to its frame. In: bytes with the time of their coming -> out: the
// frame, what came when the button was let go, or why neither can be said. No files, no clock.
#pragma once

#include <string>
#include <vector>

namespace equipoise::app {

struct Portion {
  double t_s = 0.0;
  std::string bytes;
};

struct LearntButton {
  std::string frame;
  std::string released;  // empty: letting go sends nothing, or the same
  std::string error;     // empty: the above holds
};

LearntButton learn_button(const std::vector<Portion>& portions);

}  // namespace equipoise::app
