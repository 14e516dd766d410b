#include "robots/mbbr/dynamics.hpp"

#include <gtest/gtest.h>

#include "robots/mip/dynamics.hpp"
#include "support/oracle.hpp"

namespace equipoise {
namespace {

using test::oracle_rows;
using test::relative_error;
using test::vector_of;

TEST(MbbrDynamics, MatchesTheIndependentDerivation) {
  const MbbrDynamics dynamics{MbbrParameters{}};
  const auto rows = oracle_rows("mbbr_dynamics");
  ASSERT_EQ(rows.size(), 200U);
  for (const auto& row : rows) {
    const Vec2 theta_xy = vector_of<2>(row, "theta_xy");
    const MbbrMotion m(theta_xy, body_rates(theta_xy, vector_of<3>(row, "theta_dot")),
                       vector_of<2>(row, "phi_star_dot"));
    const MbbrAccelerations a = dynamics.accelerations(m, vector_of<3>(row, "tau_B"));
    Vec<5> qdd;
    qdd << MbbrDynamics::theta_ddot(m, a), MbbrDynamics::phi_star_ddot(m, a);
    EXPECT_LT(relative_error(qdd, vector_of<5>(row, "qdd")), 1e-9);
    EXPECT_LT(relative_error(m.omega_B, vector_of<3>(row, "gyro_B")), 1e-9);
    EXPECT_LT(relative_error(MbbrDynamics::encoder_rate_B(m), vector_of<3>(row, "encoder_rate_B")), 1e-9);
    EXPECT_LT(relative_error(dynamics.accelerometer_B(m, a), vector_of<3>(row, "accel_B")), 1e-9);
  }
}

TEST(MbbrDynamics, APushAtTheCentreOfMassMovesTheBodyWithIt) {
  const MbbrDynamics dynamics{MbbrParameters{}};
  const MbbrAccelerations free = dynamics.accelerations({}, Vec3::Zero());
  const MbbrAccelerations pushed = dynamics.accelerations({}, Vec3::Zero(), Vec3(1.0, 0.0, 0.0));
  // Momentum of the whole: the centre of mass accelerates towards +x, so theta_y grows or the ball rolls that
  // way.
  const Vec2 ball = ball_velocity(0.032, pushed.phi_ddot_inertial - free.phi_ddot_inertial);
  const double com = ball.x() + 0.100 * pushed.omega_dot_B.y();
  EXPECT_GT(com, 0.0);
  EXPECT_NEAR(pushed.omega_dot_B.x(), 0.0, 1e-12);
}

TEST(MbbrDynamics, EnergyIsConservedWithoutTorqueAndPush) {
  const MbbrParameters p;
  const MbbrDynamics dynamics{p};
  MbbrMotion m(Vec2(0.05, -0.03), Vec3(0.2, 0.1, 5.0), Vec2(3.0, -2.0));
  const auto energy = [&](const MbbrMotion& s) {
    const Vec2 vb = ball_velocity(p.r, s.phi_dot_star);
    Mat3 R;
    R << s.cy(), s.sy() * s.sx(), s.sy() * s.cx(), 0, s.cx(), -s.sx(), -s.sy(), s.cy() * s.sx(),
        s.cy() * s.cx();
    const Vec3 v_com = Vec3(vb.x(), vb.y(), 0) + R * s.omega_B.cross(Vec3(0, 0, p.l));
    const Vec3 w = s.omega_B;
    const Vec3 wheel = MbbrDynamics::encoder_rate_B(s);
    return 0.5 * (p.I_t1 * w.x() * w.x() + p.I_t2 * w.y() * w.y() + p.I_t3 * w.z() * w.z()) +
           0.5 * p.m_t * v_com.squaredNorm() + 0.5 * p.m_b * vb.squaredNorm() +
           0.5 * p.I_b * s.phi_dot_star.squaredNorm() + 0.5 * p.I_w * wheel.squaredNorm() +
           p.m_t * kGravity_m_s2 * p.l * R(2, 2);
  };
  const double before = energy(m);
  const double h = 1e-5;
  for (int i = 0; i < 10000; ++i) {  // midpoint rule, 0.1 s
    const auto step = [&](const MbbrMotion& at, const MbbrMotion& from, double dt) {
      const MbbrAccelerations a = dynamics.accelerations(at, Vec3::Zero());
      return MbbrMotion(from.theta_xy() + dt * at.theta_dot().head<2>(), from.omega_B + dt * a.omega_dot_B,
                        from.phi_dot_star + dt * MbbrDynamics::phi_star_ddot(at, a));
    };
    m = step(step(m, m, 0.5 * h), m, h);
  }
  EXPECT_NEAR(energy(m), before, 1e-6 * std::abs(before));
}

TEST(MipDynamics, MatchesTheIndependentDerivation) {
  const MipDynamics dynamics(MipParameters{}, false);
  const auto rows = oracle_rows("mip_dynamics");
  ASSERT_EQ(rows.size(), 200U);
  for (const auto& row : rows) {
    MipMotion m;
    m.theta = row["theta"];
    m.theta_dot = row["theta_dot"];
    m.phi_dot = row["phi_dot"];
    m.psi_dot = row["psi_dot"];
    const Vec3 qdd = dynamics.accelerations_from_inputs(m, row["u_x"], row["u_z"]);
    EXPECT_LT(relative_error(qdd, vector_of<3>(row, "qdd")), 1e-9);
    EXPECT_LT(relative_error(dynamics.accelerometer_B(m, qdd), vector_of<3>(row, "accel_B")), 1e-9);
  }
}

}  // namespace
}  // namespace equipoise
