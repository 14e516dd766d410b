#include "app/remote/frame_learning.hpp"

#include <algorithm>

#include "app/remote/remote_file.hpp"

namespace equipoise::app {
namespace {

/// The shortest text that this one repeats.
std::string root_of(const std::string& text) {
  for (std::size_t n = 1; n < text.size(); ++n) {
    if (text.size() % n != 0) continue;
    bool repeats = true;
    for (std::size_t i = n; i < text.size() && repeats; ++i) repeats = text[i] == text[i - n];
    if (repeats) return text.substr(0, n);
  }
  return text;
}

/// Bytes that come within a frame's time of each other belong together; frames that were sent together, too.
std::vector<std::string> bursts(const std::vector<Portion>& portions) {
  constexpr double kGap_s = 0.03;
  std::vector<std::string> out;
  double before_s = -1e9;
  for (const Portion& portion : portions) {
    if (portion.t_s - before_s > kGap_s) out.emplace_back();
    out.back() += portion.bytes;
    before_s = portion.t_s;
  }
  for (std::string& burst : out) burst = root_of(burst);
  return out;
}

}  // namespace

LearntButton learn_button(const std::vector<Portion>& portions) {
  constexpr std::size_t kLongest = 32;
  const std::vector<std::string> heard = bursts(portions);
  LearntButton learnt;
  if (heard.empty()) {
    learnt.error = "nothing came";
    return learnt;
  }
  learnt.frame = heard.front();
  const auto other = std::find_if(heard.begin(), heard.end(),
                                  [&](const std::string& burst) { return burst != learnt.frame; });
  if (other != heard.end()) learnt.released = *other;
  if (std::any_of(other, heard.end(), [&](const std::string& burst) { return burst != learnt.released; }))
    learnt.error = "different bytes came while it was held (" + to_hex(heard[0]) + ", " + to_hex(*other) +
                   ", ...): a value or a counter, no frame of a button";
  if (learnt.frame.size() > kLongest || learnt.released.size() > kLongest)
    learnt.error = "more than 32 bytes without a pause, and no repetition among them";
  return learnt;
}

}  // namespace equipoise::app
