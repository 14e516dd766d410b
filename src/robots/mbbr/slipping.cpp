#include "robots/mbbr/slipping.hpp"

#include <algorithm>

namespace equipoise {
namespace {

/// Acceleration of the body's centre of mass relative to the ball's centre, yaw frame.
Vec3 com_relative(const MbbrParameters& p, const MbbrMotion& m, const Vec3& omega_dot_B) noexcept {
  const Vec3 c(0.0, 0.0, p.l);
  return m.R() * (omega_dot_B.cross(c) + m.omega_B.cross(m.omega_B.cross(c)));
}

/// Rates about the body axes, slip of the contact, spin; from the eight velocities.
Mat<6, 8> constraint_rows(const MbbrMotion& m, double r) noexcept {
  Mat<6, 8> J = Mat<6, 8>::Zero();
  J.block<3, 3>(0, 0) = -Mat3::Identity();
  J.block<3, 3>(0, 3) = m.R().transpose();
  J(3, 4) = -r;  // v - r S phi'
  J(4, 3) = r;
  J(3, 6) = 1.0;
  J(4, 7) = 1.0;
  J(5, 5) = 1.0;
  return J;
}

}  // namespace

bool MbbrSlipping::carries(const MbbrFloorForce& needed) const noexcept {
  const double most = floor_.grip * std::max(needed.normal_N, 0.0);
  return needed.force_star_N.norm() <= most && std::abs(needed.torsion_N_m) <= most * floor_.torsion_radius_m;
}

MbbrFloorForce MbbrSlipping::needed(const MbbrMotion& m, const MbbrLoads& loads,
                                    const MbbrAccelerations& a) const noexcept {
  const Vec2 centre = ball_velocity(p_.r, a.phi_ddot_inertial);
  const Vec3 com = com_relative(p_, m, a.omega_dot_B);
  const Vec3 push_star = m.R() * loads.push_B;
  MbbrFloorForce f;
  f.force_star_N =
      (p_.m_b + p_.m_t) * centre + p_.m_t * com.head<2>() - push_star.head<2>() - loads.pull_star;
  f.normal_N = (p_.m_b + p_.m_t) * kGravity_m_s2 + p_.m_t * com.z() - push_star.z();
  const Vec3 ball_rate_B = m.R().transpose().leftCols<2>() * m.phi_dot_star;
  const Vec3 on_ball = p_.I_w * m.omega_B.cross(ball_rate_B) + loads.tau_B + p_.I_w * a.omega_dot_B;
  f.torsion_N_m = -m.R().row(2).dot(on_ball);  // the ball does not begin to spin
  return f;
}

MbbrSlipping::Mass MbbrSlipping::mass(const MbbrMotion& m) const noexcept {
  const Mat3& R = m.R();
  const double ml = p_.m_t * p_.l;
  Mat<8, 8> M = Mat<8, 8>::Zero();
  M.diagonal() << p_.I_t1 + ml * p_.l + p_.I_w, p_.I_t2 + ml * p_.l + p_.I_w, p_.I_t3 + p_.I_w,
      Vec3::Constant(p_.I_b + p_.I_w), Vec2::Constant(p_.m_b + p_.m_t);
  M.block<3, 3>(0, 3) = -p_.I_w * R.transpose();
  for (int i = 0; i < 2; ++i) M.block<3, 1>(0, 6 + i) = ml * Vec3(-R(i, 1), R(i, 0), 0.0);  // m [c]x e_i
  M.triangularView<Eigen::StrictlyLower>() = M.transpose();
  return Mass(M);
}

MbbrSlipAccelerations MbbrSlipping::accelerations(const MbbrMotion& m, const Mass& mass,
                                                  const MbbrLoads& loads,
                                                  const MbbrFloorForce& floor) const noexcept {
  const Vec3& w = m.omega_B;
  const Mat3& R = m.R();
  const Vec3 ball_rate_B = R.transpose() * Vec3(m.phi_dot_star.x(), m.phi_dot_star.y(), m.spin_rad_s);
  const Vec3 c(0.0, 0.0, p_.l);
  const Vec3 on_ball = p_.I_w * w.cross(ball_rate_B) + loads.tau_B;
  const Vec3 on_body = loads.push_B - p_.m_t * w.cross(w.cross(c));
  const Vec3 weight_B = -p_.m_t * kGravity_m_s2 * R.row(2).transpose();
  const Vec3 I_t(p_.I_t1, p_.I_t2, p_.I_t3);
  Vec<8> b;
  b.head<3>() = -w.cross(I_t.cwiseProduct(w)) + c.cross(on_body + weight_B) - on_ball;
  b.segment<3>(3) =
      R * on_ball + Vec3(p_.r * floor.force_star_N.y(), -p_.r * floor.force_star_N.x(), floor.torsion_N_m);
  b.tail<2>() = (R * on_body).head<2>() + loads.pull_star + floor.force_star_N;
  const Vec<8> a = mass.solve(b);
  return {a.head<3>(), a.segment<3>(3), a.tail<2>()};
}

MbbrFriction MbbrSlipping::friction(const MbbrMotion& m, const Mass& mass, const Vec<6>& free, double step_s,
                                    const Vec3& limit_B, double normal_N) const noexcept {
  constexpr int kSweeps = 40;
  const Mat<6, 8> J = constraint_rows(m, p_.r);
  const Mat<8, 6> effect = mass.solve(J.transpose().eval());
  const Mat<6, 6> A = step_s * J * effect;
  const double most = floor_.grip * std::max(normal_N, 0.0);
  Vec<6> limit;
  limit << limit_B, most, most, most * floor_.torsion_radius_m;
  Vec<6> f = Vec<6>::Zero();
  bool holds = true;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {  // projected Gauss-Seidel; the floor's force lies in a disk
    for (int i = 0; i < 6; ++i) {
      f(i) = std::clamp(f(i) - (free(i) + A.row(i).dot(f)) / A(i, i), -limit(i), limit(i));
    }
    const double slides = f.segment<2>(3).norm();
    holds = slides <= most && std::abs(f(5)) < limit(5);
    if (slides > most) f.segment<2>(3) *= most / slides;
  }
  MbbrFriction result;
  result.axes_B = f.head<3>();
  result.floor = {f.segment<2>(3), f(5), normal_N};
  result.floor_holds = holds;
  return result;
}

MbbrAccelerations felt_as_rolling(const MbbrSlipAccelerations& a, double ball_radius_m) noexcept {
  return {a.omega_dot_B, Vec2(-a.centre_star.y(), a.centre_star.x()) / ball_radius_m};
}

}  // namespace equipoise
