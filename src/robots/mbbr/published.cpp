#include "robots/mbbr/published.hpp"

namespace equipoise {

void MbbrPublishedModel::predict(const Vec<13>& x, const Vec3& u, Vec<13>& x_next,
                                 Mat<13, 13>& F) const noexcept {
  const double tx = x(kThetaX), ty = x(kThetaY);
  const double dtx = x(kThetaDotX), dty = x(kThetaDotY), dtz = x(kThetaDotZ);
  const double dpx = x(kPhiDotX), dpy = x(kPhiDotY);
  const double ux = u.x(), uy = u.y(), uz = u.z();

  Vec<13> f;
  // (5.28)
  const double f5L = 130 * tx - 8.9 * dtx + 8.9 * dpx - 130 * ux;
  const double f6L = 130 * ty - 8.9 * dty + 8.9 * dpy - 130 * uy;
  const double f7L = -280 * tx + 34 * dtx - 34 * dpx + 410 * ux;
  const double f8L = -280 * ty + 34 * dty - 34 * dpy + 410 * uy;
  // (5.32)
  f << dtx, dty, dtz, dpx, dpy,
      f5L + dtz * (-12 * ty + 1.8 * dty + 0.0029 * dpy) + 0.80 * tx * dtz * dtz - 310 * ty * uz,
      f6L + dtz * (12 * tx - 1.8 * dtx - 0.0029 * dpx) + 0.80 * ty * dtz * dtz + 310 * tx * uz,
      -15 * dtz - 220 * uz + dpx * (14 * ty + 0.015 * dty) - dpy * (5.2 * tx + 0.015 * dtx) +
          dtz * (0.012 * tx * dpx + 0.015 * ty * dpy) + 7.5 * ty * ux - 140 * tx * uy,
      f7L + dtz * (-6.5 * ty + 0.44 * dty - 0.0062 * dpy) + 0.44 * tx * dtz * dtz + 400 * ty * uz,
      f8L + dtz * (6.5 * tx - 0.44 * dtx + 0.0062 * dpx) + 0.44 * ty * dtz * dtz - 400 * tx * uz, ty * dtz,
      -tx * dtz, ty * dpx - tx * dpy;

  Mat<13, 13> A = Mat<13, 13>::Zero();
  for (int i = 0; i < 5; ++i) A(i, i + kThetaDotX) = 1.0;
  A(kThetaDotX, kThetaX) = 130 + 0.80 * dtz * dtz;
  A(kThetaDotX, kThetaY) = -12 * dtz - 310 * uz;
  A(kThetaDotX, kThetaDotX) = -8.9;
  A(kThetaDotX, kThetaDotY) = 1.8 * dtz;
  A(kThetaDotX, kThetaDotZ) = -12 * ty + 1.8 * dty + 0.0029 * dpy + 1.60 * tx * dtz;
  A(kThetaDotX, kPhiDotX) = 8.9;
  A(kThetaDotX, kPhiDotY) = 0.0029 * dtz;
  A(kThetaDotY, kThetaX) = 12 * dtz + 310 * uz;
  A(kThetaDotY, kThetaY) = 130 + 0.80 * dtz * dtz;
  A(kThetaDotY, kThetaDotX) = -1.8 * dtz;
  A(kThetaDotY, kThetaDotY) = -8.9;
  A(kThetaDotY, kThetaDotZ) = 12 * tx - 1.8 * dtx - 0.0029 * dpx + 1.60 * ty * dtz;
  A(kThetaDotY, kPhiDotX) = -0.0029 * dtz;
  A(kThetaDotY, kPhiDotY) = 8.9;
  A(kThetaDotZ, kThetaX) = -5.2 * dpy + 0.012 * dtz * dpx - 140 * uy;
  A(kThetaDotZ, kThetaY) = 14 * dpx + 0.015 * dtz * dpy + 7.5 * ux;
  A(kThetaDotZ, kThetaDotX) = -0.015 * dpy;
  A(kThetaDotZ, kThetaDotY) = 0.015 * dpx;
  A(kThetaDotZ, kThetaDotZ) = -15 + 0.012 * tx * dpx + 0.015 * ty * dpy;
  A(kThetaDotZ, kPhiDotX) = 14 * ty + 0.015 * dty + 0.012 * tx * dtz;
  A(kThetaDotZ, kPhiDotY) = -5.2 * tx - 0.015 * dtx + 0.015 * ty * dtz;
  A(kPhiDotX, kThetaX) = -280 + 0.44 * dtz * dtz;
  A(kPhiDotX, kThetaY) = -6.5 * dtz + 400 * uz;
  A(kPhiDotX, kThetaDotX) = 34;
  A(kPhiDotX, kThetaDotY) = 0.44 * dtz;
  A(kPhiDotX, kThetaDotZ) = -6.5 * ty + 0.44 * dty - 0.0062 * dpy + 0.88 * tx * dtz;
  A(kPhiDotX, kPhiDotX) = -34;
  A(kPhiDotX, kPhiDotY) = -0.0062 * dtz;
  A(kPhiDotY, kThetaX) = 6.5 * dtz - 400 * uz;
  A(kPhiDotY, kThetaY) = -280 + 0.44 * dtz * dtz;
  A(kPhiDotY, kThetaDotX) = -0.44 * dtz;
  A(kPhiDotY, kThetaDotY) = 34;
  A(kPhiDotY, kThetaDotZ) = 6.5 * tx - 0.44 * dtx + 0.0062 * dpx + 0.88 * ty * dtz;
  A(kPhiDotY, kPhiDotX) = 0.0062 * dtz;
  A(kPhiDotY, kPhiDotY) = -34;
  A(kSlipX, kThetaY) = dtz;
  A(kSlipX, kThetaDotZ) = ty;
  A(kSlipY, kThetaX) = -dtz;
  A(kSlipY, kThetaDotZ) = -tx;
  A(kSlipZ, kThetaX) = -dpy;
  A(kSlipZ, kThetaY) = dpx;
  A(kSlipZ, kPhiDotX) = ty;
  A(kSlipZ, kPhiDotY) = -tx;

  x_next = x + kTickS * f;  // (6.1)
  F = Mat<13, 13>::Identity() + kTickS * A;
}

void MbbrPublishedModel::measure(const Vec<13>& x, const Vec3& u, Vec<8>& y, Mat<8, 13>& H) const noexcept {
  const double tx = x(kThetaX), ty = x(kThetaY);
  const double dtx = x(kThetaDotX), dty = x(kThetaDotY), dtz = x(kThetaDotZ);
  const double dpx = x(kPhiDotX), dpy = x(kPhiDotY);
  const double uz = u.z();
  // (5.29)
  const double h5L = -4.6 * ty + 0.5 * dty - 0.5 * dpy + 7.8 * u.y();
  const double h6L = 4.6 * tx - 0.5 * dtx + 0.5 * dpx - 7.8 * u.x();
  // (5.33)
  y << dtx - ty * dtz, dty + tx * dtz, dtz,  //
      x(kPhiX) - tx + x(kSlipX), x(kPhiY) - ty + x(kSlipY), -x(kThetaZ) + x(kSlipZ),
      h5L + dtz * (0.32 * tx - 0.022 * dtx + 0.00032 * dpx) + 0.022 * ty * dtz * dtz - 3.1 * tx * uz,
      h6L + dtz * (0.32 * ty - 0.022 * dty + 0.00032 * dpy) - 0.022 * tx * dtz * dtz - 3.1 * ty * uz;

  H.setZero();
  H(0, kThetaDotX) = 1.0;
  H(0, kThetaY) = -dtz;
  H(0, kThetaDotZ) = -ty;
  H(1, kThetaDotY) = 1.0;
  H(1, kThetaX) = dtz;
  H(1, kThetaDotZ) = tx;
  H(2, kThetaDotZ) = 1.0;
  H(3, kPhiX) = 1.0;
  H(3, kThetaX) = -1.0;
  H(3, kSlipX) = 1.0;
  H(4, kPhiY) = 1.0;
  H(4, kThetaY) = -1.0;
  H(4, kSlipY) = 1.0;
  H(5, kThetaZ) = -1.0;
  H(5, kSlipZ) = 1.0;
  H(6, kThetaX) = 0.32 * dtz - 3.1 * uz;
  H(6, kThetaY) = -4.6 + 0.022 * dtz * dtz;
  H(6, kThetaDotX) = -0.022 * dtz;
  H(6, kThetaDotY) = 0.5;
  H(6, kThetaDotZ) = 0.32 * tx - 0.022 * dtx + 0.00032 * dpx + 0.044 * ty * dtz;
  H(6, kPhiDotX) = 0.00032 * dtz;
  H(6, kPhiDotY) = -0.5;
  H(7, kThetaX) = 4.6 - 0.022 * dtz * dtz;
  H(7, kThetaY) = 0.32 * dtz - 3.1 * uz;
  H(7, kThetaDotX) = -0.5;
  H(7, kThetaDotY) = -0.022 * dtz;
  H(7, kThetaDotZ) = 0.32 * ty - 0.022 * dty + 0.00032 * dpy - 0.044 * tx * dtz;
  H(7, kPhiDotX) = 0.5;
  H(7, kPhiDotY) = 0.00032 * dtz;
}

}  // namespace equipoise
