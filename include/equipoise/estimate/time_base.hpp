// One time base for sensors of different age: the filter runs at t - age, where the IMU's samples belong, so
// encoders are interpolated to that instant, and the inputs that acted up to it are mixed. In: inputs and
// encoder angles per tick, age of the IMU's samples -> out: what acted and what stood then, and the steps
// that lead from then to now. RT-safe: fixed size, bounded.
#pragma once

#include <algorithm>
#include <array>

#include "equipoise/samples.hpp"

namespace equipoise {

template <int Inputs, int Wheels>
class TimeBase {
 public:
  static constexpr int kMaxTicks = 2;
  static constexpr double kMaxAge_s = kMaxTicks * kTickS;
  using Input = Vec<Inputs>;
  using Angles = Vec<Wheels>;
  using Flags = std::array<bool, Wheels>;

  /// `age_s`: 0 to kMaxAge_s.
  explicit TimeBase(double age_s) noexcept
      : age_s_(std::clamp(age_s, 0.0, kMaxAge_s)),
        whole_(std::min(static_cast<int>(age_s_ / kTickS), kMaxTicks - 1)),
        part_(age_s_ / kTickS - whole_) {}

  double age_s() const noexcept { return age_s_; }

  /// The robot stands: nothing has moved or acted.
  void reset(const Angles& angles) noexcept {
    inputs_.fill(Input::Zero());
    angles_.fill(angles);
    known_.fill(all_true<Wheels>());
  }

  /// A tick passes: `u` acted since the last one.
  void advance(const Input& u) noexcept {
    for (std::size_t i = kMaxTicks; i > 0; --i) {
      inputs_[i] = inputs_[i - 1];
      angles_[i] = angles_[i - 1];
      known_[i] = known_[i - 1];
    }
    inputs_.front() = u;
    known_.front().fill(false);
  }

  /// Encoders of this tick.
  void observe(const Angles& angles, const Flags& known) noexcept {
    angles_.front() = angles;
    known_.front() = known;
  }

  /// Since the tick before.
  bool stands(int wheel) const noexcept { return angles_[0](wheel) == angles_[1](wheel); }

  /// Mean input over the filter's last tick, which ended `age` ago.
  Input acted() const noexcept { return (1.0 - part_) * input(0) + part_ * input(1); }

  /// Where the wheels stood `age` ago; `rate()` bridges samples that are missing.
  template <class Rate>
  Angles stood(Rate&& rate) const noexcept {
    const auto w = static_cast<std::size_t>(whole_);
    Angles then = angles_[w] + part_ * (angles_[w + 1] - angles_[w]);
    Flags known;
    bool all = true;
    for (std::size_t i = 0; i < Wheels; ++i) {
      known[i] = known_[w][i] && known_[w + 1][i];
      all = all && known[i];
    }
    if (all) return then;
    const Angles bridged = angles_.front() - age_s_ * rate();
    for (std::size_t i = 0; i < Wheels; ++i) {
      if (!known[i]) then(static_cast<int>(i)) = bridged(static_cast<int>(i));
    }
    return then;
  }

  /// step(u, dt) for each stretch of constant input from `age` ago to now.
  template <class Step>
  void to_now(Step step) const noexcept {
    if (part_ > 0.0) step(input(0), part_ * kTickS);
    for (int i = whole_ - 1; i >= 0; --i) step(inputs_[static_cast<std::size_t>(i)], kTickS);
  }

 private:
  const Input& input(std::size_t earlier) const noexcept {
    return inputs_[static_cast<std::size_t>(whole_) + earlier];
  }

  double age_s_;
  int whole_;                                  // ticks of the age
  double part_;                                // and the rest, in ticks: 0 to 1
  std::array<Input, kMaxTicks + 1> inputs_{};  // latest first
  std::array<Angles, kMaxTicks + 1> angles_{};
  std::array<Flags, kMaxTicks + 1> known_{};
};

}  // namespace equipoise
