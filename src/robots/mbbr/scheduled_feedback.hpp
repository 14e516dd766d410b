// State feedback with the full coupled gain scheduled over yaw rate.
// In: state errors -> out: u about the body axes, before compensations. The tilt and translation of a
// symmetric body at constant yaw rate are one complex system, so each gain is a complex number; its imaginary
// part is the cross gain that grows with the spin. Gains, feed-forward and reference lean are designed at
// start (design.hpp, docs/derivation.md). Needs body-rate feedback. RT-safe.
#pragma once

#include "robots/mbbr/design.hpp"
#include "robots/mbbr/reference.hpp"

namespace equipoise {

struct MbbrScheduledFeedbackParams {
  MbbrGains gains;
  bool yaw_feedforward = true;
};

class MbbrScheduledFeedback {
 public:
  static constexpr bool kSharesDuty = true;
  using Params = MbbrScheduledFeedbackParams;
  explicit MbbrScheduledFeedback(const Params& params) : p_(params) {}

  Vec3 update(const MbbrReference& ref) noexcept;

 private:
  Params p_;
  Vec2 d_u_before_ = Vec2::Zero();  // what the feedback asked for at the last tick, on its way to the motors
};

}  // namespace equipoise
