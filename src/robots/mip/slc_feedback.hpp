// Successive loop closure of the MIP, [T] Fig. 3.3: the outer loop D2 turns the wheel error into a lean, the
// inner loop D1 the lean error into u_x; yaw by PD and feed-forward, (3.52). In: state errors -> out: u_x,
// u_z. Designed at start for 200 Hz, or as published for 100 Hz, which runs every other tick
// (docs/derivation.md). Limits are inside the filters, so that saturation does not wind up D1's integrator.
// RT-safe.
#pragma once

#include <algorithm>
#include <cmath>

#include "robots/mip/design.hpp"
#include "robots/mip/reference.hpp"

namespace equipoise {

/// Second-order difference equation whose output is limited before it is remembered.
class LimitedSecondOrder {
 public:
  explicit LimitedSecondOrder(const SecondOrder& c) : c_(c) {}
  void reset() noexcept { e1_ = e2_ = y1_ = y2_ = 0.0; }
  double update(double e, double limit) noexcept {
    const double y = c_.b0 * e + c_.b1 * e1_ + c_.b2 * e2_ - c_.a1 * y1_ - c_.a2 * y2_;
    e2_ = e1_;
    e1_ = e;
    y2_ = y1_;
    y1_ = std::clamp(y, -limit, limit);
    return y1_;
  }

 private:
  SecondOrder c_;
  double e1_ = 0.0, e2_ = 0.0, y1_ = 0.0, y2_ = 0.0;
};

struct MipSlcParams {
  MipGains gains;
  bool published = false;      // [T]'s robot library, 100 Hz
  double max_lean_rad = 0.30;  // limit of theta_ref
  double max_u = 1.5;          // beyond the supply; friction and bridge compensation come after
  double soft_start_s = 0.2;   // u_x may grow to its limit over this time
};

class MipSlcFeedback {
 public:
  static constexpr bool kSharesDuty = true;
  using Params = MipSlcParams;
  explicit MipSlcFeedback(const Params& params)
      : p_(params),
        yaw_(params.published ? params.gains.yaw_published : params.gains.yaw),
        every_(params.published ? static_cast<int>(std::lround(kTickHz / kMipPublishedHz)) : 1),
        D1_(params.published ? kMipPublishedD1 : params.gains.slc.D1),
        D2_(params.published ? kMipPublishedD2 : params.gains.slc.D2) {}

  Vec2 update(const MipReference& ref) noexcept {
    if (ref.restart) {
      D1_.reset();
      D2_.reset();
      ticks_ = 0;
    }
    if (ticks_ % every_ == 0) {
      const double grown = p_.soft_start_s > 0.0 ? ticks_ * kTickS / p_.soft_start_s : 1.0;
      const double theta_ref = D2_.update(ref.d_phi, p_.max_lean_rad);
      u_x_ = D1_.update(theta_ref + ref.d_theta, p_.max_u * std::min(grown, 1.0));
    }
    ticks_ = std::min(ticks_ + 1, 1 << 20);
    return {u_x_, yaw_.angle * ref.d_psi + yaw_.rate * ref.d_psi_dot + yaw_.feedforward * ref.psi_dot};
  }

 private:
  Params p_;
  MipYawGains yaw_;
  int every_;
  LimitedSecondOrder D1_, D2_;
  int ticks_ = 0;
  double u_x_ = 0.0;
};

}  // namespace equipoise
