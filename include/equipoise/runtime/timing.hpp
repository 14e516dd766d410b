// Timing of the loop: lateness and compute time per tick, a histogram of both, and what to do about overruns.
// In: loop clock at wake-up and at the end of the tick, due time -> out: TickTiming, and whether the motors
// may go on. A tick that was missed is skipped and counted, never made up for; several missed at once, or
// overruns in several ticks in a row, are kOverrun for actuate/safety. RT-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace equipoise::runtime {

struct TickTiming {
  std::int64_t wake_late_ns = 0;  // after the data-ready edge or the deadline
  std::int64_t compute_ns = 0;    // of the last whole tick: wake-up to motors written
  std::int64_t overruns = 0;      // ticks skipped since the start
};

/// Counts per octave of time, from below 1 us up to 0.5 s and more; fixed size, wait-free.
class TimeHistogram {
 public:
  static constexpr std::size_t kBins = 80;
  static constexpr std::size_t kBinsPerOctave = 4;  // 19 % wide

  void add(std::int64_t ns) noexcept {
    ++bins_[bin_of(ns)];
    ++total_;
    if (ns > max_ns_) max_ns_ = ns;
  }

  /// Upper edge of the bin that holds this share (0 .. 1) of the samples; never above the largest sample.
  std::int64_t quantile_ns(double share) const noexcept {
    const auto wanted = static_cast<std::int64_t>(share * static_cast<double>(total_));
    std::int64_t seen = 0;
    for (std::size_t i = 0; i < kBins; ++i) {
      seen += bins_[i];
      if (seen > wanted || seen == total_) return upper_ns(i) < max_ns_ ? upper_ns(i) : max_ns_;
    }
    return max_ns_;
  }

  const std::array<std::int64_t, kBins>& bins() const noexcept { return bins_; }
  std::int64_t total() const noexcept { return total_; }
  std::int64_t max_ns() const noexcept { return max_ns_; }

  static constexpr std::int64_t upper_ns(std::size_t bin) noexcept {
    const std::int64_t octave = std::int64_t{1024} << (bin / kBinsPerOctave);
    return octave + octave * static_cast<std::int64_t>(bin % kBinsPerOctave) /
                        static_cast<std::int64_t>(kBinsPerOctave);
  }

 private:
  static std::size_t bin_of(std::int64_t ns) noexcept {
    if (ns < upper_ns(0)) return 0;
    const auto octave = static_cast<std::size_t>(63 - __builtin_clzll(static_cast<std::uint64_t>(ns >> 10)));
    const auto quarter = static_cast<std::size_t>(ns >> (octave + 8) & 3);
    return std::min(1 + kBinsPerOctave * octave + quarter, kBins - 1);
  }

  std::array<std::int64_t, kBins> bins_{};
  std::int64_t total_ = 0;
  std::int64_t max_ns_ = 0;
};

class LoopTiming {
 public:
  /// At wake-up. `sample_ns`: the data-ready edge, or the last one again if none came.
  void begin(std::int64_t now_ns, std::int64_t sample_ns) noexcept {
    const bool edge = sample_ns != sample_ns_ && sample_ns <= now_ns;
    const std::int64_t due_ns = edge || due_ns_ == 0 ? sample_ns : due_ns_ + kPeriod_ns;
    now_.wake_late_ns = started_ ? (now_ns > due_ns ? now_ns - due_ns : 0) : 0;
    // Half a period of slack: an edge that comes late by less has not lost a tick.
    const std::int64_t gap = started_ ? now_ns - wake_ns_ : kPeriod_ns;
    missed_ = gap > 0 ? (gap + kPeriod_ns / 2) / kPeriod_ns - 1 : 0;
    if (missed_ < 0) missed_ = 0;
    now_.overruns += missed_;
    in_a_row_ = missed_ > 0 ? in_a_row_ + 1 : 0;
    if (started_) wake_.add(now_.wake_late_ns);
    started_ = true;
    wake_ns_ = now_ns;
    sample_ns_ = sample_ns;
    due_ns_ = missed_ > 0 ? now_ns : due_ns;
  }

  void end(std::int64_t now_ns) noexcept {
    now_.compute_ns = now_ns - wake_ns_;
    compute_.add(now_.compute_ns);
  }

  /// Too much was missed to go on with motors on.
  bool overrun() const noexcept { return missed_ > kMaxMissedAtOnce || in_a_row_ >= kMaxInARow; }

  const TickTiming& now() const noexcept { return now_; }
  const TimeHistogram& wake() const noexcept { return wake_; }
  const TimeHistogram& compute() const noexcept { return compute_; }

 private:
  static constexpr std::int64_t kPeriod_ns = 5'000'000;
  static constexpr int kMaxMissedAtOnce = 2;  // ticks; the guard acts after three
  static constexpr int kMaxInARow = 3;        // ticks, each with an overrun

  TickTiming now_;
  bool started_ = false;
  std::int64_t wake_ns_ = 0;
  std::int64_t sample_ns_ = 0;
  std::int64_t due_ns_ = 0;
  std::int64_t missed_ = 0;
  int in_a_row_ = 0;
  TimeHistogram wake_, compute_;
};

}  // namespace equipoise::runtime
