// A simulated backend to practise on: its ticks come in wall-clock time, or at a multiple of it, and what is
// to break breaks on time. In: a backend in simulated time, speed, planned faults -> out: another backend.
// Simulation only.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "app/io/fault_backend.hpp"
#include "equipoise/runtime/monotonic.hpp"

namespace equipoise::app {

struct PlannedFault {
  FaultKind kind = FaultKind::kImuOff;
  double at_s = 0.0;
  int ticks = 0;
};

/// "NAME@T" until the end, or "NAME@T+D" for D seconds; InputError says what is wrong.
PlannedFault planned_fault(const std::string& text);

class PracticeBackend : public FaultBackend {
 public:
  /// `speed`: simulated seconds in one of the wall clock.
  PracticeBackend(rio_t simulated, double speed, std::vector<PlannedFault> faults, std::uint64_t seed)
      : FaultBackend(simulated, seed), speed_(speed), faults_(std::move(faults)) {
    std::sort(faults_.begin(), faults_.end(),
              [](const PlannedFault& a, const PlannedFault& b) { return a.at_s < b.at_s; });
  }

  /// A log that cannot be written is a fault outside the boundary.
  bool breaks_log() const noexcept {
    return std::any_of(faults_.begin(), faults_.end(),
                       [](const PlannedFault& f) { return f.kind == FaultKind::kLogFull; });
  }

 private:
  int wait_tick(std::int64_t* now_ns) override {
    for (; next_ < faults_.size() && faults_[next_].at_s <= time_s_; ++next_)
      start(faults_[next_].kind, faults_[next_].ticks);
    const int status = FaultBackend::wait_tick(now_ns);
    if (status == 0) keep_pace(*now_ns);
    return status;
  }

  void keep_pace(std::int64_t simulated_ns) {
    constexpr std::int64_t kLost_ns = 200'000'000;  // a laptop that slept does not catch up
    time_s_ = static_cast<double>(simulated_ns) * 1e-9;
    const auto due_in = static_cast<std::int64_t>(static_cast<double>(simulated_ns) / speed_);
    const std::int64_t now_ns = runtime::monotonic_now_ns();
    if (start_ns_ == 0 || now_ns > start_ns_ + due_in + kLost_ns) start_ns_ = now_ns - due_in;
    if (start_ns_ + due_in > now_ns) runtime::sleep_until(start_ns_ + due_in);
  }

  double speed_;
  std::vector<PlannedFault> faults_;
  std::size_t next_ = 0;
  double time_s_ = 0.0;
  std::int64_t start_ns_ = 0;
};

}  // namespace equipoise::app
