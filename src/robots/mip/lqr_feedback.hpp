// State feedback of the MIP, gains from LQR (tools/derive), with the speed held against back-EMF.
// In: state errors -> out: u_x, u_z. The wheel error is limited, so that a far target asks for a bounded
// lean; u_x starts softly. RT-safe.
#pragma once

#include <algorithm>

#include "generated/mip_gains.hpp"
#include "robots/mip/reference.hpp"

namespace equipoise {

struct MipLqrParams {
  double max_lean_rad = 0.30;  // the wheel error counts up to what this lean outweighs
  double max_u = 1.5;
  double soft_start_s = 0.2;
};

class MipLqrFeedback {
 public:
  using Params = MipLqrParams;
  explicit MipLqrFeedback(const Params& params) : p_(params) {}

  Vec2 update(const MipReference& ref) noexcept {
    using generated::mip::kLqr;
    if (ref.restart) ticks_ = 0;
    const double grown = p_.soft_start_s > 0.0 ? ticks_ * kTickS / p_.soft_start_s : 1.0;
    const double limit = p_.max_u * std::min(grown, 1.0);
    ticks_ = std::min(ticks_ + 1, 1 << 20);
    const double outer_limit = std::abs(kLqr.theta) * p_.max_lean_rad;
    const double outer = std::clamp(kLqr.phi * ref.d_phi, -outer_limit, outer_limit);
    const double u_x = kLqr.theta * ref.d_theta + outer + kLqr.theta_dot * ref.d_theta_dot +
                       kLqr.phi_dot * ref.d_phi_dot + generated::mip::kSpeed * ref.phi_dot;
    const double u_z = kLqr.yaw_angle * ref.d_psi + kLqr.yaw_rate * ref.d_psi_dot +
                       generated::mip::kYawFeedforward * ref.psi_dot;
    return {std::clamp(u_x, -limit, limit), u_z};
  }

 private:
  Params p_;
  int ticks_ = 0;
};

}  // namespace equipoise
