// What the fault detector decided in a run: one list for sim, run, replay and the journal. In: per tick, what
// was weighed -> out: verdicts that were taken or taken back, as JSON and as lines. observe() is RT-safe.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "equipoise/estimate/fault_hypotheses.hpp"

namespace equipoise::app {

struct FaultVerdict {
  double t_s = 0.0;
  std::uint32_t before = 0;  // FaultEvidence::verdicts, a tick ago
  FaultEvidence evidence{};

  bool taken() const noexcept { return (before & ~evidence.verdicts) == 0; }
  nlohmann::json json() const;
  /// "verdict: encoder_2, log-likelihood ratio 21.4, bound 18.6, runner-up slip 3.0"
  std::string sentence() const;
};

class FaultVerdicts {
 public:
  /// The verdict of this tick, if there is one.
  std::optional<FaultVerdict> observe(double t_s, const FaultEvidence& evidence) noexcept;

  /// null: no hypothesis was weighed.
  nlohmann::json json() const;
  const FaultVerdict* begin() const noexcept { return kept_.data(); }
  const FaultVerdict* end() const noexcept { return kept_.data() + count_; }

 private:
  static constexpr std::size_t kMost = 32;  // the first; the log has all

  bool weighed_ = false;
  std::uint32_t before_ = 0;
  std::size_t count_ = 0;
  std::array<FaultVerdict, kMost> kept_{};
};

}  // namespace equipoise::app
