// State feedback of the MIP, LQR gains designed at start (design.hpp), with the speed held against back-EMF.
// In: state errors -> out: u_x, u_z. The wheel error is limited, so that a far target asks for a bounded
// lean; u_x starts softly. RT-safe.
#pragma once

#include <algorithm>

#include "robots/mip/design.hpp"
#include "robots/mip/reference.hpp"

namespace equipoise {

struct MipLqrParams {
  MipGains gains;
  double max_lean_rad = 0.30;  // the wheel error counts up to what this lean outweighs
  double max_u = 1.5;
  double soft_start_s = 0.2;
};

class MipLqrFeedback {
 public:
  static constexpr bool kSharesDuty = true;
  using Params = MipLqrParams;
  explicit MipLqrFeedback(const Params& params) : p_(params) {}

  Vec2 update(const MipReference& ref) noexcept {
    const MipLqrGains& k = p_.gains.lqr;
    if (ref.restart) {
      ticks_ = 0;
      feedback_before_ = 0.0;
    }
    const double grown = p_.soft_start_s > 0.0 ? ticks_ * kTickS / p_.soft_start_s : 1.0;
    const double limit = p_.max_u * std::min(grown, 1.0);
    ticks_ = std::min(ticks_ + 1, 1 << 20);
    const double outer_limit = std::abs(k.theta) * p_.max_lean_rad;
    const double outer = std::clamp(k.phi * ref.d_phi, -outer_limit, outer_limit);
    const double feedback = k.theta * ref.d_theta + outer + k.theta_dot * ref.d_theta_dot +
                            k.phi_dot * ref.d_phi_dot + k.u_before * feedback_before_;
    const double against_back_emf = p_.gains.speed * ref.phi_dot;
    const double u_x = std::clamp(feedback + against_back_emf, -limit, limit);
    feedback_before_ = u_x - against_back_emf;
    const MipYawGains& yaw = p_.gains.yaw;
    return {u_x, yaw.angle * ref.d_psi + yaw.rate * ref.d_psi_dot + yaw.feedforward * ref.psi_dot};
  }

 private:
  Params p_;
  int ticks_ = 0;
  double feedback_before_ = 0.0;  // on its way to the motors
};

}  // namespace equipoise
