// How a run ended and why: one judge, one struct, one printer for sim, run, replay and log. In: per tick,
// what was asked, what the motors did, the reasons and, where it is known, the true tilt -> out: Verdict.
// observe() is RT-safe.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "app/text/reasons.hpp"
#include "app/trial/fault_verdict.hpp"
#include "equipoise/runtime/record.hpp"

namespace equipoise::app {

enum class Ended : std::size_t { kFinished, kFell, kDisarmed, kInterrupted, kDevice };
inline constexpr std::array<const char*, 5> kEndedNames{"finished", "fell", "disarmed", "interrupted",
                                                        "device"};

struct Verdict {
  Ended ended = Ended::kFinished;
  std::uint32_t reasons = 0;  // SafetyReason bits: when the motors went off, else at the end
  double fell_at_s = 0.0;     // when it fell or was disarmed
  double duration_s = 0.0;
  ReasonNumbers numbers{};  // of the tick that `reasons` are of, where a tick was at hand
  FaultVerdicts faults;     // of all ticks

  bool fell() const noexcept { return ended == Ended::kFell || ended == Ended::kDisarmed; }
  const char* name() const noexcept {
    // cppcheck-suppress CastIntegerToAddressAtReturn
    return kEndedNames[static_cast<std::size_t>(ended)];
  }
  /// "Fell over at 3.20 s: tilt."
  std::string sentence() const;
  /// Adds ended, reasons, fell, fell_at_s, verdicts.
  void write(nlohmann::json* out) const;

  /// As in a log.
  runtime::EndRecord record() const noexcept;
  static Verdict of(const runtime::EndRecord& record) noexcept;
};

/// A line for each verdict on a sensor, and for each reason of a run that did not end as asked.
void print_reasons(std::FILE* out, const Verdict& verdict, const SafetyParams& limits);

class VerdictJudge {
 public:
  /// A robot that has leaned further has fallen over.
  static constexpr double kFallenTilt_rad = 0.6;

  struct Tick {
    double t_s;
    bool asked;  // for motors
    bool driven;
    std::uint32_t reasons;
    double true_tilt_rad;  // NaN where nobody knows
    ReasonNumbers numbers{};
    FaultEvidence faults{};
  };
  void observe(const Tick& tick) noexcept;

  /// Fell, or the motors went off while they were asked for.
  bool lost() const noexcept { return lost_; }
  /// Asked for more than a moment, and never armed so far.
  bool refused() const noexcept { return refused_; }
  bool armed() const noexcept { return armed_; }

  Verdict verdict(bool stopped, bool device_failed) const noexcept;

 private:
  void lose(Ended how, const Tick& tick) noexcept;

  bool armed_ = false;  // at least once
  bool lost_ = false;
  bool refused_ = false;
  double asked_from_s_ = -1.0;
  Verdict verdict_;
};

}  // namespace equipoise::app
