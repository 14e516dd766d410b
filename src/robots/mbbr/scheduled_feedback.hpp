// State feedback with the full coupled gain scheduled over yaw rate.
// In: state errors -> out: u about the body axes, before compensations. The tilt and translation of a
// symmetric body at constant yaw rate are one complex system, so each gain is a complex number; its imaginary
// part is the cross gain that grows with the spin. Gains, feed-forward and reference lean are generated
// (tools/derive, docs/derivation.md). Needs body-rate feedback. Stateless, RT-safe.
#pragma once

#include "generated/mbbr_gains.hpp"
#include "robots/mbbr/reference.hpp"

namespace equipoise {

struct MbbrScheduledFeedbackParams {
  bool yaw_feedforward = true;
};

class MbbrScheduledFeedback {
 public:
  using Params = MbbrScheduledFeedbackParams;
  explicit MbbrScheduledFeedback(const Params& params) : p_(params) {}

  Vec3 update(const MbbrReference& ref) const noexcept;

 private:
  Params p_;
};

}  // namespace equipoise
