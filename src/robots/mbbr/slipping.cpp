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

/// A wheel on the ball with its rotor and the friction between motor and contact. Rates at the wheel, at the
/// end of the step: the ball's is `ball` + `ball_gain` x contact torque.
struct RotorContact {
  double ball, ball_gain;
  double rotor, compliance, gear_N_m;

  double rotor_rate(double torque) const noexcept {
    const double driven = rotor - compliance * torque;
    return std::copysign(std::max(0.0, std::abs(driven) - compliance * gear_N_m), driven);
  }
  /// That ends the step without slip.
  double sticking_torque() const noexcept {
    const double locked = -ball / ball_gain;
    const double driven = rotor - compliance * locked;
    if (std::abs(driven) <= compliance * gear_N_m) return locked;
    return (rotor - std::copysign(compliance * gear_N_m, driven) - ball) / (ball_gain + compliance);
  }
};

}  // namespace

bool MbbrSlipping::carries(const MbbrFloorForce& needed) const noexcept {
  if (!limited()) return true;
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
                                    const Vec3& limit_B, const MbbrRotors& rotors,
                                    double normal_N) const noexcept {
  const Mat<6, 8> J = constraint_rows(m, p_.r);
  const Mat<6, 6> A = step_s * J * mass.solve(J.transpose().eval());
  const double most = limited() ? floor_.grip * std::max(normal_N, 0.0) : kNeverGivesWay;
  return contact_friction(A, free, limit_B, rotors,
                          {most, limited() ? most * floor_.torsion_radius_m : kNeverGivesWay, normal_N});
}

/// Projected Gauss-Seidel. Rows: axes, wheels, floor. A rotor and its gear are solved with its contact.
MbbrFriction contact_friction(const Mat<6, 6>& response, const Vec<6>& free, const Vec3& limit_B,
                              const MbbrRotors& rotors, const MbbrFloorLimits& floor) noexcept {
  const int sweeps = rotors.loose ? 200 : 40;  // few where no rotor is coupled
  constexpr double kSame_N = 1e-9;
  Mat<9, 6> rows = Mat<9, 6>::Zero();
  rows.topLeftCorner<3, 3>().setIdentity();
  rows.block<3, 3>(3, 0) = rotors.axes_B.transpose();
  rows.bottomRightCorner<3, 3>().setIdentity();
  const Mat<9, 9> A = rows * response * rows.transpose();
  const Vec<9> b = rows * free;
  Vec<9> f = Vec<9>::Zero();
  const auto others = [&](int i) { return b(i) + A.row(i).dot(f) - A(i, i) * f(i); };
  MbbrFriction result;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    const Vec<9> before = f;
    for (int i = 0; i < 3; ++i) f(i) = std::clamp(-others(i) / A(i, i), -limit_B(i), limit_B(i));
    result.holds = true;
    for (int i = 0; i < 3 && rotors.loose; ++i) {
      const RotorContact contact{others(3 + i), A(3 + i, 3 + i), rotors.free_rad_s(i), rotors.compliance(i),
                                 rotors.gear_N_m(i)};
      const double sticking = contact.sticking_torque();
      f(3 + i) = std::clamp(sticking, -rotors.grip_N_m(i), rotors.grip_N_m(i));
      result.rotor_rad_s(i) = contact.rotor_rate(f(3 + i));
      result.holds = result.holds && f(3 + i) == sticking;
    }
    for (int i = 6; i < 8; ++i) f(i) = std::clamp(-others(i) / A(i, i), -floor.force_N, floor.force_N);
    const double slides = f.segment<2>(6).norm();
    if (slides > floor.force_N) f.segment<2>(6) *= floor.force_N / slides;
    f(8) = std::clamp(-others(8) / A(8, 8), -floor.torsion_N_m, floor.torsion_N_m);
    result.holds = result.holds && slides <= floor.force_N && std::abs(f(8)) < floor.torsion_N_m;
    if ((f - before).cwiseAbs().maxCoeff() < kSame_N) break;
  }
  result.axes_B = f.head<3>();
  result.wheels = f.segment<3>(3);
  result.floor = {f.segment<2>(6), f(8), floor.normal_N};
  return result;
}

MbbrAccelerations felt_as_rolling(const MbbrSlipAccelerations& a, double ball_radius_m) noexcept {
  return {a.omega_dot_B, Vec2(-a.centre_star.y(), a.centre_star.x()) / ball_radius_m};
}

}  // namespace equipoise
