// Scheduled controller of the MBBR from its parameters and the weights of the configuration: complex LQR over
// yaw rate, yaw gains, and what a moving reference needs.
// In: parameters, weights -> out: gains. Source: docs/derivation.md. Start-up only: allocates.
#pragma once

#include "equipoise/control/gain_schedule.hpp"
#include "equipoise/control/governor.hpp"
#include "equipoise/control/plausible.hpp"
#include "equipoise/control/riccati.hpp"
#include "robots/mbbr/mbbr.hpp"

namespace equipoise {

/// Bryson's rule: a weight is 1 / (deviation worth one unit of u)^2.
struct MbbrDesignParams {
  double theta_rad = 0.1;
  double phi_rad = 1.0;
  double body_rate_rad_s = 3.0;
  double phi_dot_rad_s = 5.0;
  double u = 1.0;
  double theta_z_rad = 1.0;
  double theta_z_dot_rad_s = 5.0;
  double u_z = 1.0;
  double input_delay_s = 0.0;  // from the tick to the torque
  double step_hz = 0.25;       // of the table over yaw rate
  double last_hz = 3.5;
};

/// u = theta d_theta + phi d_phi + body_rate d_body_rate + phi_dot d_phi_dot + u_before d_u_before
///     + (speed - i speed_turn theta_z') ref_phi_dot + drive ref_phi_ddot,
/// d = estimate - reference in the yaw frame; theta_ref = lean ref_phi_ddot, body rate ref. its
/// inertial rate; ref_phi_ddot is the inertial acceleration of the reference ball angles, resolved in the yaw
/// frame. The schedule holds
/// yaw rates >= 0; for negative ones take the complex conjugates.
struct MbbrGains {
  enum Gain : std::size_t { kTheta, kPhi, kBodyRate, kPhiDot, kUBefore, kGains };
  GainSchedule<2 * kGains> schedule;  // real and imaginary part of each gain; at: yaw rate, rad/s
  double speed = 0.0;                 // (k2_ball + mu_v) / k1
  double speed_turn = 0.0;            // I_w / k1
  double lean = 0.0;                  // rad per rad/s^2
  double drive = 0.0;
  double yaw_angle = 0.0;  // u_z = yaw_angle d_theta_z + yaw_rate d_theta_z' + yaw_feedforward ref_theta_z'
  double yaw_rate = 0.0;
  double yaw_feedforward = 0.0;
};

/// Tilt and translation at a constant yaw rate, with the u_z that holds it, as one complex system of
/// (theta, phi* error, body rate, phi*' error), each x + i y; input u_x + i u_y. A body whose two inertias
/// differ is taken for one of their mean: the complex form is that of a symmetric body.
struct MbbrLinear {
  CMatrix A;
  CMatrix b;
};
MbbrLinear mbbr_linear(const MbbrParameters& p, double yaw_rate_rad_s);

/// K of u = -K (states, u before) at one yaw rate.
CMatrix mbbr_lqr(const MbbrParameters& p, const MbbrDesignParams& d, double yaw_rate_rad_s);

/// What keeps this robot from being balanced, if anything; `wheel_torque_N_m`: of one stalled motor.
std::optional<DesignProblem> design_problem(const MbbrParameters& p, const MbbrDesignParams& d,
                                            double wheel_torque_N_m);

/// Acceleration whose lean takes a third of the tilt that the full torque can bring back.
double feasible_acceleration_m_s2(const MbbrParameters& p);
/// And with which that lean comes no faster than the robot falls.
double feasible_jerk_m_s3(const MbbrParameters& p);

/// What steady motion takes of each wheel's duty; `friction_share`: of Coulomb friction that is compensated.
DutyBudget mbbr_duty_budget(const MbbrParameters& p, double share, double friction_share);

MbbrGains design_mbbr(const MbbrParameters& p, const MbbrDesignParams& d);

}  // namespace equipoise
