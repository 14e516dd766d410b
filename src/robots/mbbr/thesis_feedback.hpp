// State feedback of the dissertation, gains scheduled over the reference yaw rate.
// In: state errors -> out: u about the body axes, before compensations. u = -K x_e, [T] (6.10), Table 6.3.
// The steady yaw torque against back-EMF is fed forward unless switched off. Stateless, RT-safe.
#pragma once

#include "robots/mbbr/reference.hpp"

namespace equipoise {

struct MbbrThesisFeedbackParams {
  enum Column : std::size_t { kC1, kC2, kC3, kC4, kC5, kC6, kColumns };
  GainSchedule<kColumns> schedule;           // at: yaw rate, rad/s
  double yaw_feedforward_s = -15.0 / 219.0;  // u_z per rad/s that holds a yaw rate; 0: as in [T]
};

class MbbrThesisFeedback {
 public:
  static constexpr bool kSharesDuty = false;  // each wheel for itself, as in [T]
  using Params = MbbrThesisFeedbackParams;
  explicit MbbrThesisFeedback(const Params& params) : p_(params) {}

  Vec3 update(const MbbrReference& ref) const noexcept {
    const auto c = p_.schedule(std::abs(ref.yaw_rate));
    const Vec2 u = -(c[Params::kC1] * ref.d_theta + c[Params::kC2] * ref.d_phi + c[Params::kC3] * ref.d_rate +
                     c[Params::kC4] * ref.d_phi_dot);
    const double u_z = -(c[Params::kC5] * ref.d_theta_z + c[Params::kC6] * ref.d_yaw_rate) +
                       p_.yaw_feedforward_s * ref.yaw_rate;
    return {u.x(), u.y(), u_z};
  }

 private:
  Params p_;
};

}  // namespace equipoise
