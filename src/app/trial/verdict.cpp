#include "app/trial/verdict.hpp"

#include "app/text/format.hpp"
#include "app/text/json.hpp"

namespace equipoise::app {
namespace {

constexpr double kPatience_s = 0.1;  // between the request and armed motors
// The estimate, which safety judges by, passes the limit a little before or after the truth.
constexpr double kSurelyFalling_rad = 0.9 * VerdictJudge::kFallenTilt_rad;

bool falling(const VerdictJudge::Tick& tick) noexcept {
  return (tick.reasons & kTilt) != 0 && !(tick.true_tilt_rad < kSurelyFalling_rad);
}

}  // namespace

void VerdictJudge::lose(Ended how, const Tick& tick) noexcept {
  verdict_.ended = how;
  verdict_.reasons = tick.reasons;
  verdict_.fell_at_s = tick.t_s;
}

void VerdictJudge::observe(const Tick& tick) noexcept {
  verdict_.duration_s = tick.t_s;
  verdict_.faults.observe(tick.t_s, tick.faults);
  if (lost_) return;
  verdict_.reasons = tick.reasons;
  armed_ = armed_ || tick.driven;
  verdict_.numbers = tick.numbers;
  verdict_.numbers.was_armed = armed_;
  if (!tick.asked) asked_from_s_ = -1.0;
  if (tick.asked && asked_from_s_ < 0.0) asked_from_s_ = tick.t_s;
  const bool off = tick.asked && !tick.driven;
  refused_ = off && !armed_ && tick.t_s > asked_from_s_ + kPatience_s;
  lost_ = (off && armed_) || tick.true_tilt_rad > kFallenTilt_rad;
  if (lost_)
    lose(tick.true_tilt_rad > kFallenTilt_rad || falling(tick) ? Ended::kFell : Ended::kDisarmed, tick);
}

Verdict VerdictJudge::verdict(bool stopped, bool device_failed) const noexcept {
  Verdict out = verdict_;
  if (lost_) return out;
  if (device_failed) {
    out.ended = Ended::kDevice;
  } else if (refused_) {
    out.ended = Ended::kDisarmed;
    out.fell_at_s = out.duration_s;
  } else if (stopped) {
    out.ended = Ended::kInterrupted;
  }
  return out;
}

std::string Verdict::sentence() const {
  constexpr std::array<const char*, 5> kHow{"Finished after", "Fell over at", "Disarmed unexpectedly at",
                                            "Interrupted after", "The device failed after"};
  const char* const how = kHow[static_cast<std::size_t>(ended)];
  const std::string why = reasons == 0 ? "" : ": " + reasons_text(reasons);
  if (fell()) return format("%s %.2f s", how, fell_at_s) + why;
  return format("%s %.1f s", how, duration_s) + (reasons == 0 ? ", upright" : ", motors off" + why);
}

void Verdict::write(nlohmann::json* out) const {
  (*out)["ended"] = name();
  (*out)["reasons"] = reason_names(reasons);
  (*out)["fell"] = fell();
  (*out)["fell_at_s"] = fell() ? nlohmann::json(fell_at_s) : nlohmann::json(nullptr);
  (*out)["verdicts"] = faults.json();
}

void print_reasons(std::FILE* out, const Verdict& verdict, const SafetyParams& limits) {
  for (const FaultVerdict& each : verdict.faults)
    std::fprintf(out, "  %.3f s  %s\n", each.t_s, each.sentence().c_str());
  if (!verdict.fell()) return;
  for (const std::string& line : reasons_explained(verdict.reasons, verdict.numbers, limits))
    std::fprintf(out, "  %s\n", line.c_str());
}

runtime::EndRecord Verdict::record() const noexcept {
  return {static_cast<std::int32_t>(ended), reasons, fell() ? fell_at_s : std::nan(""), duration_s};
}

Verdict Verdict::of(const runtime::EndRecord& record) noexcept {
  Verdict out;
  if (record.ended > 0 && record.ended < static_cast<std::int32_t>(kEndedNames.size()))
    out.ended = static_cast<Ended>(record.ended);
  out.reasons = record.reasons;
  if (out.fell()) out.fell_at_s = record.fell_at_s;
  out.duration_s = record.duration_s;
  return out;
}

}  // namespace equipoise::app
