#include "robots/mip/design.hpp"

#include <algorithm>
#include <cmath>

#include "robots/mip/models.hpp"

namespace equipoise {
namespace {

double weight(double deviation) { return 1.0 / (deviation * deviation); }

/// The u that holds a radian of lean, and the wheels' acceleration under it.
double hold_per_lean(const MipLinear& s) { return std::abs(s.A(2, 0) / s.b(2, 0)); }
double wheel_per_lean(const MipLinear& s) {
  return std::abs(s.A(3, 0).real() + s.b(3, 0).real() * hold_per_lean(s));
}

/// Second order in s, ascending powers.
struct Polynomial {
  double c0, c1, c2;
};

/// Tustin's rule.
SecondOrder discrete(const Polynomial& top, const Polynomial& bottom) {
  const double k = 2.0 * kTickHz;
  const auto in_z = [k](const Polynomial& s) {  // s = k (z - 1)/(z + 1), times (z + 1)^2
    const double second = s.c2 * k * k;
    return Vec3(second + s.c1 * k + s.c0, 2.0 * (s.c0 - second), second - s.c1 * k + s.c0);
  };
  const Vec3 b = in_z(top);
  const Vec3 a = in_z(bottom);
  return {b(0) / a(0), b(1) / a(0), b(2) / a(0), a(1) / a(0), a(2) / a(0)};
}

/// (psi, psi') and u_z.
MipLinear mip_yaw_linear(const MipParameters& p) {
  const MipCoefficients c = mip_coefficients(p, 0.0, p.l);
  MipLinear s{CMatrix::Zero(2, 2), CMatrix::Zero(2, 1)};
  s.A(0, 1) = 1.0;
  s.A(1, 1) = c.psi_ddot_dps;
  s.b(1, 0) = c.psi_ddot_uz;
  return s;
}

MipSlcGains design_mip_slc(const MipParameters& p, const MipSlcDesign& d) {
  const MipLinear s = mip_linear(p, 0.0);
  const Eigen::Matrix4d A = s.A.real();
  CMatrix tilt_and_rates(3, 3);  // without phi, which is an integrator
  tilt_and_rates << 0.0, 1.0, 0.0, A(2, 0), 0.0, A(2, 3), A(3, 0), 0.0, A(3, 3);
  const Eigen::VectorXd poles = eigenvalues(tilt_and_rates).real();
  const double unstable = poles.maxCoeff();
  const double fastest = -poles.minCoeff();
  const double hold = hold_per_lean(s);

  const double integral = d.integral_p * unstable;
  const double lead = d.lead_q * fastest;
  const double outer_gain = d.outer_gain_pp_a * unstable * unstable / wheel_per_lean(s);
  const double zero = d.outer_zero_p * unstable;
  const double pole = d.outer_pole_p * unstable;
  const double gain = -d.gain_U * hold;
  MipSlcGains g;
  g.D1 = discrete({gain * integral, gain * (1.0 + integral / lead), gain / lead},
                  {0.0, 1.0, 1.0 / d.roll_off_rad_s});
  g.D2 = discrete({outer_gain, outer_gain / zero, 0.0},
                  {1.0, 1.0 / pole + 1.0 / d.outer_roll_off_rad_s, 1.0 / (pole * d.outer_roll_off_rad_s)});
  return g;
}

}  // namespace

MipLinear mip_linear(const MipParameters& p, double yaw_rate_rad_s) {
  const MipCoefficients c = mip_coefficients(p, 0.0, p.l);
  const double turn2 = yaw_rate_rad_s * yaw_rate_rad_s;
  MipLinear s{CMatrix::Zero(4, 4), CMatrix::Zero(4, 1)};
  s.A(0, 2) = s.A(1, 3) = 1.0;
  s.A(2, 0) = c.theta_ddot_th + c.theta_ddot_th_dps2 * turn2;
  s.A(2, 3) = c.theta_ddot_dph;
  s.A(3, 0) = c.phi_ddot_th + c.phi_ddot_th_dps2 * turn2;
  s.A(3, 3) = c.phi_ddot_dph;
  s.b(2, 0) = c.theta_ddot_ux;
  s.b(3, 0) = c.phi_ddot_ux;
  return s;
}

std::optional<DesignProblem> design_problem(const MipParameters& p, const MipDesignParams& d,
                                            double wheel_torque_N_m) {
  const double gyration_m = std::sqrt(p.I_b1 / p.m_b);  // Table 3.2: 0.88
  if (auto bad =
          outside("com_height_m", "height over the body's radius of gyration", p.l / gyration_m, 0.1, 4.0))
    return bad;
  if (auto bad =
          outside("k1_N_m", "over the torque of a motor of [motor]", p.k1 / wheel_torque_N_m, 0.3, 3.0))
    return bad;
  const MipLinear s = mip_linear(p, 0.0);
  if (auto bad = beyond_recovery(s.A, s.b, 0)) return bad;
  for (const CMatrix& A : {s.A, mip_yaw_linear(p).A}) {
    if (auto bad = too_fast_for_the_tick("k1_N_m, k2_N_m_s or the inertias", A)) return bad;
  }
  const MipGains g = design_mip(p, d);
  CMatrix K(1, 5);
  K << g.lqr.theta, g.lqr.phi, g.lqr.theta_dot, g.lqr.phi_dot, -g.lqr.u_before;
  return without_margin(sampled(s.A, s.b, kTickS, d.input_delay_s), K);
}

std::optional<DesignProblem> slc_problem(const MipParameters& p, const MipDesignParams& d,
                                         const MipSlcGains& g) {
  const MipLinear plant = mip_linear(p, 0.0);
  const SampledSystem loop = sampled(plant.A, plant.b, kTickS, d.input_delay_s);
  const auto response = [](const SecondOrder& c, Complex z) {
    return (c.b0 * z * z + c.b1 * z + c.b2) / (z * z + c.a1 * z + c.a2);
  };
  const auto feedback = [&](Complex z) {
    const Complex inner = response(g.D1, z);
    return CMatrix{{inner, inner * response(g.D2, z), 0.0, 0.0, 0.0}};
  };
  // One tick of plant and compensators; states x, u before, D1's two, D2's two.
  constexpr Eigen::Index kAll = 9;
  CMatrix step = CMatrix::Zero(kAll, kAll);
  for (Eigen::Index i = 0; i < kAll; ++i) {
    const CMatrix s = CMatrix::Identity(kAll, kAll).col(i);
    const Complex theta_ref = s(7, 0) - g.D2.b0 * s(1, 0);
    const Complex error = theta_ref - s(0, 0);
    const Complex u = g.D1.b0 * error + s(5, 0);
    step.col(i).head(4) = loop.A * s.topRows(4) + loop.B * u + loop.B_late * s(4, 0);
    step.col(i).tail(5) << u, g.D1.b1 * error - g.D1.a1 * u + s(6, 0), g.D1.b2 * error - g.D1.a2 * u,
        -g.D2.b1 * s(1, 0) - g.D2.a1 * theta_ref + s(8, 0), -g.D2.b2 * s(1, 0) - g.D2.a2 * theta_ref;
  }
  return without_margin(loop, eigenvalues(step).cwiseAbs().maxCoeff(), feedback);
}

double feasible_acceleration_m_s2(const MipParameters& p) {
  const MipLinear s = mip_linear(p, 0.0);
  return recoverable(s.A, s.b, 0).limit / 3.0 * wheel_per_lean(s) * p.r;
}

double feasible_jerk_m_s3(const MipParameters& p) {
  const MipLinear s = mip_linear(p, 0.0);
  return feasible_acceleration_m_s2(p) * recoverable(s.A, s.b, 0).pole_rad_s;
}

DutyBudget mip_duty_budget(const MipParameters& p, const MipWheelBudget& wheel, double friction_share) {
  constexpr double kLeast_s = 1e-9;  // without back-EMF and friction only the wheels' rate is a limit
  const double against_back_emf = std::max((p.k2 + p.mu_v) / p.k1, kLeast_s);
  DutyBudget b;
  b.of_friction = friction_share * p.mu_c / p.k1;
  b.share = std::min(wheel.duty_share, b.of_friction + against_back_emf * wheel.max_rate_rad_s);
  b.per_yaw_rate = p.yaw_to_wheel() * against_back_emf;
  b.per_speed = against_back_emf / p.r;
  return b;
}

MipGains design_mip(const MipParameters& p, const MipDesignParams& d) {
  MipGains g;
  g.slc = design_mip_slc(p, d.slc);

  const MipLinear s = mip_linear(p, 0.0);
  const CMatrix K = lqr(sampled(s.A, s.b, kTickS, d.input_delay_s),
                        Vec<4>(weight(d.lqr.theta_rad), weight(d.lqr.phi_rad), weight(d.lqr.theta_dot_rad_s),
                               weight(d.lqr.phi_dot_rad_s)),
                        Vec<1>(weight(d.lqr.u_x)));
  g.lqr = {K(0, 0).real(), K(0, 1).real(), K(0, 2).real(), K(0, 3).real(), -K(0, 4).real()};

  const MipLinear yaw = mip_yaw_linear(p);
  const CMatrix K_z =
      lqr(sampled(yaw.A, yaw.b, kTickS, 0.0), Vec2(weight(d.yaw.psi_rad), weight(d.yaw.psi_dot_rad_s)),
          Vec<1>(weight(d.yaw.u_z)));
  const double against_back_emf = (-yaw.A(1, 1) / yaw.b(1, 0)).real();
  g.yaw = {K_z(0, 0).real(), K_z(0, 1).real(), against_back_emf};
  g.yaw_published = {1.0, 0.05, against_back_emf};
  g.speed = (-s.A(2, 3) / s.b(2, 0)).real();
  return g;
}

}  // namespace equipoise
