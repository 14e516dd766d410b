#include "robots/mbbr/design.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "robots/mbbr/high_yaw.hpp"

namespace equipoise {
namespace {

constexpr Complex kI{0.0, 1.0};

MbbrParameters symmetric(const MbbrParameters& p) {
  MbbrParameters s = p;
  s.I_t1 = s.I_t2 = 0.5 * (p.I_t1 + p.I_t2);
  return s;
}

/// u_z per rad/s of yaw rate, against back-EMF and viscous friction.
double yaw_feedforward(const MbbrParameters& p) { return -(p.k2_ball + p.mu_v) / p.k1; }

/// Accelerations (transport included) about upright at a steady yaw rate.
struct Jacobians {
  Mat<5, 7> state;
  Mat<5, 3> input;
};
Jacobians jacobians(const MbbrParameters& p, double yaw_rate_rad_s) {
  const MbbrCoefficients c = mbbr_coefficients(symmetric(p));
  MbbrHighYaw::State x = MbbrHighYaw::State::Zero();
  x(MbbrHighYaw::kThetaDotZ) = yaw_rate_rad_s;
  const Vec3 u(0.0, 0.0, yaw_feedforward(p) * yaw_rate_rad_s);
  Jacobians out;
  Vec<5> a;
  MbbrHighYaw::accelerations(c, x, u, a, out.state);
  out.input = MbbrHighYaw::input_matrix(c, x, u);
  return out;
}

double weight(double deviation) { return 1.0 / (deviation * deviation); }

/// Lean and u per rad/s^2 of ball acceleration, from the model at rest.
Vec2 steady_motion(const MbbrLinear& rest) {
  Eigen::Matrix2d balance;
  balance << rest.A(2, 0).real(), rest.b(2, 0).real(), rest.A(3, 0).real(), rest.b(3, 0).real();
  return balance.partialPivLu().solve(Vec2(0.0, 1.0));
}

CMatrix yaw_lqr(const MbbrParameters& p, const MbbrDesignParams& d) {
  const Jacobians J = jacobians(p, 0.0);
  CMatrix A = CMatrix::Zero(2, 2);
  A(0, 1) = 1.0;
  A(1, 1) = J.state(2, MbbrHighYaw::kThetaDotZ);
  CMatrix b = CMatrix::Zero(2, 1);
  b(1, 0) = J.input(2, 2);
  return lqr(sampled(A, b, kTickS, 0.0), Vec2(weight(d.theta_z_rad), weight(d.theta_z_dot_rad_s)),
             Vec<1>(weight(d.u_z)));
}

}  // namespace

MbbrLinear mbbr_linear(const MbbrParameters& p, double yaw_rate_rad_s) {
  using I = MbbrHighYaw;
  const Jacobians J = jacobians(p, yaw_rate_rad_s);
  const auto complex_of = [&J](int row, I::Index x) { return Complex(J.state(row, x), J.state(row + 1, x)); };
  const Complex turn = kI * yaw_rate_rad_s;
  using Row = Eigen::Matrix<Complex, 1, 4>;
  Row z_dot;  // theta' = body rate - i theta_z' theta
  z_dot << -turn, 0.0, 1.0, 0.0;
  // From theta, theta' and phi*' to the rows theta_x'' + i theta_y'' and phi_x*'' + i phi_y*''.
  const auto acceleration = [&](int row) {
    Row out = complex_of(row, I::kThetaDotX) * z_dot;
    out(0) += complex_of(row, I::kThetaX);
    out(3) += complex_of(row, I::kPhiDotX);
    return out;
  };
  MbbrLinear s{CMatrix::Zero(4, 4), CMatrix::Zero(4, 1)};
  s.A.row(0) = z_dot;
  s.A.row(1) << 0.0, -turn, 0.0, 1.0;
  s.A.row(2) = acceleration(0) + turn * z_dot;
  s.A.row(3) = acceleration(3);
  s.b(2, 0) = Complex(J.input(0, 0), J.input(1, 0));
  s.b(3, 0) = Complex(J.input(3, 0), J.input(4, 0));
  return s;
}

CMatrix mbbr_lqr(const MbbrParameters& p, const MbbrDesignParams& d, double yaw_rate_rad_s) {
  const MbbrLinear s = mbbr_linear(p, yaw_rate_rad_s);
  return lqr(
      sampled(s.A, s.b, kTickS, d.input_delay_s),
      Vec<4>(weight(d.theta_rad), weight(d.phi_rad), weight(d.body_rate_rad_s), weight(d.phi_dot_rad_s)),
      Vec<1>(weight(d.u)));
}

std::optional<DesignProblem> design_problem(const MbbrParameters& p, const MbbrDesignParams& d,
                                            double wheel_torque_N_m) {
  // What a body of one piece can be; generous: Table 5.2 has 1.5, 0.55, 1.0, 1.0.
  const double gyration_m = std::sqrt(0.5 * (p.I_t1 + p.I_t2) / p.m_t);
  if (auto bad =
          outside("com_height_m", "height over the body's radius of gyration", p.l / gyration_m, 0.2, 5.0))
    return bad;
  if (auto bad = outside("ball_inertia_kg_m2", "inertia over mass x radius^2", p.I_b / (p.m_b * p.r * p.r),
                         0.1, 1.5))
    return bad;
  if (auto bad = outside("wheel_radius_m", "over the ball's", p.r_w / p.r, 0.05, 1.0)) return bad;
  if (auto bad =
          outside("k1_N_m", "over the torque of a motor of [motor]", p.k1 / wheel_torque_N_m, 0.3, 3.0))
    return bad;

  for (const double yaw_rate : {0.0, 2.0 * kPi * d.last_hz}) {
    const MbbrLinear s = mbbr_linear(p, yaw_rate);
    if (auto bad = beyond_recovery(s.A, s.b, 0)) return bad;
    if (auto bad = too_fast_for_the_tick("k1_N_m, k2_ball_N_m_s or the inertias", s.A)) return bad;
    const CMatrix K = mbbr_lqr(p, d, yaw_rate);
    if (auto bad = without_margin(sampled(s.A, s.b, kTickS, d.input_delay_s), K)) return bad;
  }
  return std::nullopt;
}

double feasible_acceleration_m_s2(const MbbrParameters& p) {
  const MbbrLinear s = mbbr_linear(p, 0.0);
  return recoverable(s.A, s.b, 0).limit / 3.0 / steady_motion(s).x() * p.r;
}

double feasible_jerk_m_s3(const MbbrParameters& p) {
  const MbbrLinear s = mbbr_linear(p, 0.0);
  return feasible_acceleration_m_s2(p) * recoverable(s.A, s.b, 0).pole_rad_s;
}

DutyBudget mbbr_duty_budget(const MbbrParameters& p, double share, double friction_share) {
  const MbbrKinematics kinematics(p);
  double about_z = 0.0;       // largest duty of a wheel per unit of u_z,
  double horizontally = 0.0;  // and per unit of u in the plane, in its worst direction
  const Vec3 z = kinematics.wheels_from_axes(Vec3::UnitZ());
  const Vec3 x = kinematics.wheels_from_axes(Vec3::UnitX());
  const Vec3 y = kinematics.wheels_from_axes(Vec3::UnitY());
  for (int i = 0; i < Mbbr::kWheels; ++i) {
    about_z = std::max(about_z, std::abs(z(i)));
    horizontally = std::max(horizontally, std::hypot(x(i), y(i)));
  }
  const double against_back_emf = (p.k2_ball + p.mu_v) / p.k1;
  DutyBudget b;
  b.share = share;
  b.of_friction = friction_share * p.mu_c / p.k1 * std::max(about_z, horizontally);
  b.per_yaw_rate = about_z * against_back_emf;
  b.per_speed = horizontally * against_back_emf / p.r;
  return b;
}

MbbrGains design_mbbr(const MbbrParameters& p, const MbbrDesignParams& d) {
  MbbrGains g;
  const std::size_t rows = static_cast<std::size_t>(std::lround(d.last_hz / d.step_hz)) + 1;
  g.schedule.rows = std::min(rows, g.schedule.at.size());
  for (std::size_t i = 0; i < g.schedule.rows; ++i) {
    g.schedule.at[i] = 2.0 * kPi * d.step_hz * static_cast<double>(i);
    const CMatrix K = mbbr_lqr(p, d, g.schedule.at[i]);
    for (std::size_t k = 0; k < MbbrGains::kGains; ++k) {
      const Complex gain = -K(0, static_cast<Eigen::Index>(k));
      g.schedule.row[i][2 * k] = gain.real();
      g.schedule.row[i][2 * k + 1] = gain.imag();
    }
  }
  const MbbrLinear rest = mbbr_linear(p, 0.0);
  g.lean = steady_motion(rest).x();
  g.drive = steady_motion(rest).y();
  g.speed = (-rest.A(2, 3) / rest.b(2, 0)).real();
  const MbbrLinear turning = mbbr_linear(p, 1.0);
  g.speed_turn = (turning.A(2, 3) / turning.b(2, 0)).imag();

  const CMatrix K_z = yaw_lqr(p, d);
  g.yaw_angle = -K_z(0, 0).real();
  g.yaw_rate = -K_z(0, 1).real();
  g.yaw_feedforward = yaw_feedforward(p);
  return g;
}

}  // namespace equipoise
