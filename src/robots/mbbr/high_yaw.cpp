#include "robots/mbbr/high_yaw.hpp"

#include "equipoise/estimate/heun.hpp"
#include "robots/mbbr/published.hpp"

namespace equipoise {

MbbrCoefficients mbbr_coefficients(const MbbrParameters& p) noexcept {
  generated::mbbr::Parameters g{};
  g.m_t = p.m_t;
  g.m_b = p.m_b;
  g.r = p.r;
  g.r_w = p.r_w;
  g.l = p.l;
  g.l_az = p.l_a.z();
  g.I_t1 = p.I_t1;
  g.I_t2 = p.I_t2;
  g.I_t3 = p.I_t3;
  g.I_b = p.I_b;
  g.I_w = p.I_w;
  g.k1 = p.k1;
  g.k2_ball = p.k2_ball;
  g.mu_v = p.mu_v;
  g.g = kGravity_m_s2;
  return generated::mbbr::coefficients<double>(g);
}

void MbbrHighYaw::accelerations(const MbbrCoefficients& c, const State& x, const Vec3& u, Vec<5>& a,
                                Mat<5, 7>& J) noexcept {
  double rows[5][7];
  generated::mbbr::accelerations(c, x.data(), u.data(), a.data(), rows);
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 7; ++j) J(i, j) = rows[i][j];
  }
  // phi*' lives in a frame that turns with theta_z'.
  a(3) += x(kThetaDotZ) * x(kPhiDotY);
  J(3, kThetaDotZ) += x(kPhiDotY);
  J(3, kPhiDotY) += x(kThetaDotZ);
  a(4) -= x(kThetaDotZ) * x(kPhiDotX);
  J(4, kThetaDotZ) -= x(kPhiDotX);
  J(4, kPhiDotX) -= x(kThetaDotZ);
}

Mat<5, 3> MbbrHighYaw::input_matrix(const MbbrCoefficients& c, const State& x, const Vec3& u) noexcept {
  Vec<5> free;
  Vec<5> driven;
  Mat<5, 7> J;
  accelerations(c, x, u, free, J);
  Mat<5, 3> B;
  for (int k = 0; k < 3; ++k) {
    accelerations(c, x, u + Vec3::Unit(k), driven, J);
    B.col(k) = driven - free;
  }
  return B;
}

void MbbrHighYaw::inertial_rows(const MbbrCoefficients& c, const State& x, const Vec3& u, Vec<5>& y,
                                Mat<5, 7>& J) noexcept {
  J.setZero();
  // theta_z'' has theta_x theta_y'', and theta_y'' is not small: without its integral in the yaw gyro's row
  // the filter would read tilt out of it, and the ball speed error grows fivefold.
  y.head<3>() = body_rates(x.head<2>(), x.segment<3>(kThetaDotX));
  J(0, kThetaDotX) = 1.0;
  J(0, kThetaY) = -x(kThetaDotZ);
  J(0, kThetaDotZ) = -x(kThetaY);
  J(1, kThetaDotY) = 1.0;
  J(1, kThetaX) = x(kThetaDotZ);
  J(1, kThetaDotZ) = x(kThetaX);
  J(2, kThetaDotZ) = 1.0;
  J(2, kThetaX) = -x(kThetaDotY);
  J(2, kThetaDotY) = -x(kThetaX);
  double rows[2][7];
  generated::mbbr::accelerometer(c, x.data(), u.data(), y.data() + 3, rows);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 7; ++j) J(3 + i, j) = rows[i][j];
  }
}

namespace {

/// d(phi_B)/dt to first order in the tilt, [T] (5.31) with the -theta_y it drops in h5.
/// Returns the three rates without the -theta_x', -theta_y' that the encoder rows carry as -theta_x,
/// -theta_y.
Vec3 encoder_sums_rate(const MbbrHighYaw::State& x) noexcept {
  using I = MbbrHighYaw;
  return {x(I::kPhiDotX) + x(I::kThetaY) * x(I::kThetaDotZ),
          x(I::kPhiDotY) - x(I::kThetaX) * x(I::kThetaDotZ),
          x(I::kThetaY) * x(I::kPhiDotX) - x(I::kThetaX) * x(I::kPhiDotY) - x(I::kThetaDotZ)};
}

Mat<3, 7> slip_jacobian(const MbbrHighYaw::State& x) noexcept {
  using I = MbbrHighYaw;
  Mat<3, 7> J = Mat<3, 7>::Zero();
  J(0, I::kThetaY) = x(I::kThetaDotZ);
  J(0, I::kThetaDotZ) = x(I::kThetaY);
  J(1, I::kThetaX) = -x(I::kThetaDotZ);
  J(1, I::kThetaDotZ) = -x(I::kThetaX);
  J(2, I::kThetaX) = -x(I::kPhiDotY);
  J(2, I::kThetaY) = x(I::kPhiDotX);
  J(2, I::kPhiDotX) = x(I::kThetaY);
  J(2, I::kPhiDotY) = -x(I::kThetaX);
  return J;
}

}  // namespace

/// Flattened: the Jacobian is not asked for and falls away.
[[gnu::flatten]] MbbrObservable::State MbbrObservable::rate(const MbbrCoefficients& c, const State& x,
                                                            const Vec3& u) noexcept {
  const MbbrHighYaw::State d = dynamic(x);
  Vec<5> a;
  double unused[5][7];
  generated::mbbr::accelerations(c, d.data(), u.data(), a.data(), unused);
  a(3) += x(kThetaDotZ) * x(kPhiDotY);
  a(4) -= x(kThetaDotZ) * x(kPhiDotX);
  State x_dot;
  x_dot << x.segment<2>(kThetaDotX), encoder_sums_rate(d), a;
  return x_dot;
}

void MbbrObservable::derivative(const MbbrCoefficients& c, const State& x, const Vec3& u, State& x_dot,
                                Mat<10, 10>& A) noexcept {
  const MbbrHighYaw::State d = dynamic(x);
  Vec<5> a;
  Mat<5, 7> J;
  MbbrHighYaw::accelerations(c, d, u, a, J);
  x_dot << x.segment<2>(kThetaDotX), encoder_sums_rate(d), a;

  A.setZero();
  A(kThetaX, kThetaDotX) = 1.0;
  A(kThetaY, kThetaDotY) = 1.0;
  Mat<3, 7> E = slip_jacobian(d);
  E(0, MbbrHighYaw::kPhiDotX) += 1.0;
  E(1, MbbrHighYaw::kPhiDotY) += 1.0;
  E(2, MbbrHighYaw::kThetaDotZ) -= 1.0;
  A.block<3, 2>(kE, 0) = E.leftCols<2>();
  A.block<3, 5>(kE, kThetaDotX) = E.rightCols<5>();
  A.block<5, 2>(kThetaDotX, 0) = J.leftCols<2>();
  A.block<5, 5>(kThetaDotX, kThetaDotX) = J.rightCols<5>();
}

Vec3 MbbrObservable::encoder_rate_B(const State& x) noexcept {
  return encoder_sums_rate(dynamic(x)) - Vec3(x(kThetaDotX), x(kThetaDotY), 0.0);
}

void MbbrModel13::predict(const Vec<13>& x, const Vec3& u, Vec<13>& x_next, Mat<13, 13>& F) const noexcept {
  using M = MbbrPublishedModel;
  const auto derivative = [this, &u](const Vec<13>& at, Vec<13>& x_dot, Mat<13, 13>& A) {
    MbbrHighYaw::State d;
    d << at.head<2>(), at.segment<5>(M::kThetaDotX);
    Vec<5> a;
    Mat<5, 7> J;
    MbbrHighYaw::accelerations(c_, d, u, a, J);
    const Mat<3, 7> E = slip_jacobian(d);
    x_dot.head<5>() = at.segment<5>(M::kThetaDotX);
    x_dot.segment<5>(M::kThetaDotX) = a;
    x_dot(M::kSlipX) = d(MbbrHighYaw::kThetaY) * d(MbbrHighYaw::kThetaDotZ);
    x_dot(M::kSlipY) = -d(MbbrHighYaw::kThetaX) * d(MbbrHighYaw::kThetaDotZ);
    x_dot(M::kSlipZ) = d(MbbrHighYaw::kThetaY) * d(MbbrHighYaw::kPhiDotX) -
                       d(MbbrHighYaw::kThetaX) * d(MbbrHighYaw::kPhiDotY);
    A.setZero();
    A.block<5, 5>(0, M::kThetaDotX).setIdentity();
    A.block<5, 2>(M::kThetaDotX, 0) = J.leftCols<2>();
    A.block<5, 5>(M::kThetaDotX, M::kThetaDotX) = J.rightCols<5>();
    A.block<3, 2>(M::kSlipX, 0) = E.leftCols<2>();
    A.block<3, 5>(M::kSlipX, M::kThetaDotX) = E.rightCols<5>();
  };
  heun<13>(derivative, x, kTickS, x_next, F);
}

Mat<13, 3> MbbrModel13::input_matrix() const noexcept {
  Mat<13, 3> B;
  Vec<13> free;
  Vec<13> driven;
  Mat<13, 13> F;
  predict(Vec<13>::Zero(), Vec3::Zero(), free, F);
  for (int k = 0; k < 3; ++k) {
    predict(Vec<13>::Zero(), Vec3::Unit(k), driven, F);
    B.col(k) = driven - free;
  }
  return B;
}

void MbbrModel13::measure(const Vec<13>& x, const Vec3& u, Vec<8>& y, Mat<8, 13>& H) const noexcept {
  using M = MbbrPublishedModel;
  MbbrHighYaw::State d;
  d << x.head<2>(), x.segment<5>(M::kThetaDotX);
  Vec<5> h;
  Mat<5, 7> J;
  MbbrHighYaw::inertial_rows(c_, d, u, h, J);
  y << h.head<3>(), x(M::kPhiX) - x(M::kThetaX) + x(M::kSlipX), x(M::kPhiY) - x(M::kThetaY) + x(M::kSlipY),
      x(M::kSlipZ) - x(M::kThetaZ), h.tail<2>();
  H.setZero();
  H.topLeftCorner<3, 2>() = J.topLeftCorner<3, 2>();
  H.block<3, 5>(0, M::kThetaDotX) = J.topRightCorner<3, 5>();
  H.block<3, 3>(3, M::kSlipX).setIdentity();
  H(3, M::kThetaX) = -1.0;
  H(3, M::kPhiX) = 1.0;
  H(4, M::kThetaY) = -1.0;
  H(4, M::kPhiY) = 1.0;
  H(5, M::kThetaZ) = -1.0;
  H.bottomLeftCorner<2, 2>() = J.bottomLeftCorner<2, 2>();
  H.block<2, 5>(6, M::kThetaDotX) = J.bottomRightCorner<2, 5>();
}

MbbrLinearModel::MbbrLinearModel(const MbbrParameters& p, bool yaw_transport) noexcept
    : yaw_transport_(yaw_transport) {
  const MbbrCoefficients c = mbbr_coefficients(p);
  const MbbrHighYaw::State zero = MbbrHighYaw::State::Zero();
  Vec<5> a0;
  Mat<5, 7> J;
  MbbrHighYaw::accelerations(c, zero, Vec3::Zero(), a0, J);
  Vec<5> y0;
  Mat<5, 7> G;
  MbbrHighYaw::inertial_rows(c, zero, Vec3::Zero(), y0, G);

  // Rows of a: theta_x'', theta_y'', theta_z'', phi_x*'', phi_y*''; the yaw row is not modelled here.
  constexpr int accel_row[4] = {0, 1, 3, 4};
  constexpr int variable[6] = {MbbrHighYaw::kThetaX,    MbbrHighYaw::kThetaY,  MbbrHighYaw::kThetaDotX,
                               MbbrHighYaw::kThetaDotY, MbbrHighYaw::kPhiDotX, MbbrHighYaw::kPhiDotY};
  constexpr int state[6] = {0, 1, 4, 5, 6, 7};
  Mat<8, 8> A = Mat<8, 8>::Zero();
  A.topRightCorner<4, 4>().setIdentity();
  H_.setZero();
  for (int v = 0; v < 6; ++v) {
    for (int i = 0; i < 4; ++i) A(4 + i, state[v]) = J(accel_row[i], variable[v]);
    H_(0, state[v]) = G(0, variable[v]);
    H_(1, state[v]) = G(1, variable[v]);
    H_(4, state[v]) = G(3, variable[v]);
    H_(5, state[v]) = G(4, variable[v]);
  }
  H_(2, 2) = 1.0;
  H_(2, 0) = -1.0;
  H_(3, 3) = 1.0;
  H_(3, 1) = -1.0;

  const Mat<5, 3> B = kTickS * MbbrHighYaw::input_matrix(c, zero, Vec3::Zero());
  B_.setZero();
  D_.setZero();
  for (int k = 0; k < 2; ++k) {
    for (int i = 0; i < 4; ++i) B_(4 + i, k) = B(accel_row[i], k);
    Vec<5> y;
    MbbrHighYaw::inertial_rows(c, zero, Vec3::Unit(k), y, G);
    D_(4, k) = (y - y0)(3);
    D_(5, k) = (y - y0)(4);
  }
  discretise(A);
}

MbbrLinearModel MbbrLinearModel::published() noexcept {
  MbbrLinearModel m;
  Mat<8, 8> A = Mat<8, 8>::Zero();
  A.topRightCorner<4, 4>().setIdentity();
  m.B_.setZero();
  m.H_.setZero();
  m.D_.setZero();
  for (int axis = 0; axis < 2; ++axis) {
    const int theta = axis, theta_dot = 4 + axis, phi_dot = 6 + axis;
    A(theta_dot, theta) = 130.0;
    A(theta_dot, theta_dot) = -8.9;
    A(theta_dot, phi_dot) = 8.9;
    m.B_(theta_dot, axis) = kTickS * -130.0;
    A(phi_dot, theta) = -280.0;
    A(phi_dot, theta_dot) = 34.0;
    A(phi_dot, phi_dot) = -34.0;
    m.B_(phi_dot, axis) = kTickS * 410.0;
    m.H_(axis, theta_dot) = 1.0;
    m.H_(2 + axis, 2 + axis) = 1.0;
    m.H_(2 + axis, theta) = -1.0;
    const int row = 5 - axis;  // the accelerometer's y sees the rotation about x
    const double sign = axis == 0 ? 1.0 : -1.0;
    m.H_(row, theta) = sign * 4.6;
    m.H_(row, theta_dot) = sign * -0.5;
    m.H_(row, phi_dot) = sign * 0.5;
    m.D_(row, axis) = sign * -7.8;
  }
  m.discretise(A);
  return m;
}

void MbbrLinearModel::predict(const Vec<8>& x, const Vec3& u, Vec<8>& x_next, Mat<8, 8>& F) const noexcept {
  F = F_;
  if (yaw_transport_) {
    const double turn = kTickS * u.z();
    F(0, 1) += turn;  // theta' = body rate + theta_z' (theta_y, -theta_x)
    F(1, 0) -= turn;
    F(2, 1) += turn;  // (5.31)
    F(3, 0) -= turn;
    F(6, 7) += turn;
    F(7, 6) -= turn;
  }
  x_next.noalias() = F * x;
  x_next.noalias() += B_ * u;
}

void MbbrLinearModel::measure(const Vec<8>& x, const Vec3& u, Vec<6>& y, Mat<6, 8>& H) const noexcept {
  H = H_;
  y.noalias() = H_ * x;
  y.noalias() += D_ * u;
}

}  // namespace equipoise
