#include "robots/mip/models.hpp"

namespace equipoise {

MipCoefficients mip_coefficients(const MipParameters& p, double l_ay, double l_az) noexcept {
  generated::mip::Parameters g{};
  g.m_b = p.m_b;
  g.m_w = p.m_w;
  g.r = p.r;
  g.d = p.d;
  g.l = p.l;
  g.I_b1 = p.I_b1;
  g.I_b2 = p.I_b2;
  g.I_b3 = p.I_b3;
  g.I_w1 = p.I_w1;
  g.I_w2 = p.I_w2;
  g.I_r = p.I_r;
  g.k1 = p.k1;
  g.k2 = p.k2 + p.mu_v;
  g.g = kGravity_m_s2;
  g.l_ay = l_ay;
  g.l_az = l_az;
  g.lateral = 1.0;  // as the plant, docs/derivation.md
  return generated::mip::coefficients<double>(g);
}

void MipPlanarModel::predict(const Vec<4>& x, const Vec<1>& u, Vec<4>& x_next, Mat<4, 4>& F) const noexcept {
  const double in[3] = {x(0), x(2), x(3)};
  const double input[1] = {u(0)};
  double a[2];
  double J[2][3];
  generated::mip::planar_accelerations(c_, in, input, a, J);
  constexpr int kColumn[3] = {0, 2, 3};
  x_next = x;
  x_next.head<2>() += kTickS * x.tail<2>();
  F.setIdentity();
  F(0, 2) = F(1, 3) = kTickS;
  for (int i = 0; i < 2; ++i) {
    x_next(2 + i) += kTickS * a[i];
    for (int k = 0; k < 3; ++k) F(2 + i, kColumn[k]) += kTickS * J[i][k];
  }
}

Mat<4, 1> MipPlanarModel::input_matrix() const noexcept {
  return {0.0, 0.0, kTickS * c_.theta_ddot_ux, kTickS * c_.phi_ddot_ux};
}

void MipPlanarModel::measure(const Vec<4>& x, const Vec<1>& u, Vec<3>& y, Mat<3, 4>& H) const noexcept {
  const double in[3] = {x(0), x(2), x(3)};
  const double input[1] = {u(0)};
  double a[1];
  double J[1][3];
  generated::mip::planar_accelerometer(c_, in, input, a, J);
  y << x(1), x(2), a[0];
  H.setZero();
  H(0, 1) = 1.0;
  H(1, 2) = 1.0;
  H(2, 0) = J[0][0];
  H(2, 2) = J[0][1];
  H(2, 3) = J[0][2];
}

void MipInclinometerModel::predict(const Vec<2>& x, const Vec<1>& gyro, Vec<2>& x_next,
                                   Mat<2, 2>& F) const noexcept {
  x_next << x(0) + kTickS * (gyro(0) - x(1)), x(1);
  F << 1.0, -kTickS, 0.0, 1.0;
}

void MipInclinometerModel::measure(const Vec<2>& x, const Vec<1>&, Vec<1>& y, Mat<1, 2>& H) const noexcept {
  y(0) = x(0);
  H << 1.0, 0.0;
}

}  // namespace equipoise
