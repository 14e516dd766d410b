#include "app/trial/fault_verdict.hpp"

#include "app/text/format.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

/// nullptr: none, or none of this version.
const char* name_of(std::int32_t row) noexcept {
  const auto i = static_cast<std::size_t>(row);
  return row >= 0 && i < kFaultNames.size() ? kFaultNames[i] : nullptr;
}

nlohmann::json name_or_null(std::int32_t row) {
  const char* name = name_of(row);
  return name == nullptr ? nlohmann::json(nullptr) : nlohmann::json(name);
}

bool has(std::uint32_t bits, std::int32_t row) noexcept {
  return name_of(row) != nullptr && (bits >> row & 1U) != 0;
}

}  // namespace

nlohmann::json FaultVerdict::json() const {
  return {{"t_s", t_s},
          {"hypothesis", name_or_null(evidence.leading)},
          {"taken", taken()},
          {"ratio", evidence.ratio},
          {"bound", evidence.bound},
          {"runner_up", name_or_null(evidence.runner_up)},
          {"runner_up_ratio", evidence.runner_up_ratio}};
}

std::string FaultVerdict::sentence() const {
  const auto shown = [](std::int32_t row) { return name_of(row) == nullptr ? "no fault" : name_of(row); };
  const std::uint32_t found = evidence.verdicts & ~before;
  std::string who = std::string(taken() ? "verdict: " : "verdict taken back: ") + shown(evidence.leading);
  if (has(found, evidence.leading) && has(found, evidence.runner_up))
    who += std::string(" or ") + shown(evidence.runner_up);
  return who + format(", log-likelihood ratio %.1f, bound %.1f, runner-up %s %.1f", evidence.ratio,
                      evidence.bound, shown(evidence.runner_up), evidence.runner_up_ratio);
}

std::optional<FaultVerdict> FaultVerdicts::observe(double t_s, const FaultEvidence& evidence) noexcept {
  weighed_ = weighed_ || evidence.bound > 0.0;
  const FaultVerdict verdict{t_s, before_, evidence};
  before_ = evidence.verdicts;
  if (!evidence.decided) return std::nullopt;
  if (count_ < kMost) kept_[count_++] = verdict;
  return verdict;
}

nlohmann::json FaultVerdicts::json() const {
  if (!weighed_) return nullptr;
  nlohmann::json out = nlohmann::json::array();
  for (const FaultVerdict& verdict : *this) out.push_back(verdict.json());
  return out;
}

}  // namespace equipoise::app
