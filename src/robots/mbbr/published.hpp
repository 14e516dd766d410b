// The 13-state high-yaw-rate model exactly as printed, for comparison only: [T] (5.28)-(5.29), (5.32)-(5.33).
// Its known errors (docs/derivation.md): no transport term in f9, f10; 410 for 502 in (5.28); dropped
// -theta_y in h5. h2 is theta_y' + theta_x theta_z' (the printed theta_y is a slip of the pen). RT-safe.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

struct MbbrPublishedModel {
  static constexpr int kStates = 13;
  static constexpr int kInputs = 3;
  static constexpr int kOutputs = 8;
  enum State : int {
    kThetaX,
    kThetaY,
    kThetaZ,
    kPhiX,
    kPhiY,
    kThetaDotX,
    kThetaDotY,
    kThetaDotZ,
    kPhiDotX,
    kPhiDotY,
    kSlipX,
    kSlipY,
    kSlipZ,  // x11..x13: integrals of the encoder equation
  };

  void predict(const Vec<13>& x, const Vec3& u, Vec<13>& x_next, Mat<13, 13>& F) const noexcept;
  Mat<13, 3> input_matrix() const noexcept { return Mat<13, 3>::Zero(); }  // [T] has diagonal Q only
  void measure(const Vec<13>& x, const Vec3& u, Vec<8>& y, Mat<8, 13>& H) const noexcept;
};

}  // namespace equipoise
