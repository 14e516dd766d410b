// Controllers of the MIP from its parameters and the weights of the configuration: successive loop closure
// (corner frequencies relative to the robot's own poles), LQR, yaw PD.
// In: parameters, weights -> out: gains. Source: [T] Fig. 3.3, (3.52); docs/derivation.md. Start-up only.
#pragma once

#include "equipoise/control/governor.hpp"
#include "equipoise/control/plausible.hpp"
#include "equipoise/control/riccati.hpp"
#include "robots/mip/mip.hpp"

namespace equipoise {

/// out = (b0 z^2 + b1 z + b2) / (z^2 + a1 z + a2) in.
struct SecondOrder {
  double b0, b1, b2, a1, a2;
};

/// u_x = D1 (theta_ref - theta), theta_ref = D2 (phi_ref - phi), [T] (3.50)-(3.51);
/// u_z = yaw_angle (psi_ref - psi) + yaw_rate (psi_ref' - psi') + yaw_feedforward psi_ref'.
struct MipSlcGains {
  SecondOrder D1{};
  SecondOrder D2{};
};

/// u_x = sum gain (reference - estimate) + u_before (what the feedback asked for before) + speed phi_ref'.
struct MipLqrGains {
  double theta = 0.0;
  double phi = 0.0;
  double theta_dot = 0.0;
  double phi_dot = 0.0;
  double u_before = 0.0;
};

struct MipYawGains {
  double angle = 0.0;
  double rate = 0.0;
  double feedforward = 0.0;  // against back-EMF
};

struct MipGains {
  MipSlcGains slc;
  MipLqrGains lqr;
  MipYawGains yaw;
  MipYawGains yaw_published;
  double speed = 0.0;  // u_x per rad/s of phi', against back-EMF
};

/// D1 = -gain (s + integral)(s/lead + 1) / (s (s/roll_off + 1)),
/// D2 = outer_gain (s/zero + 1) / ((s/pole + 1)(s/roll_off + 1)). Relative to the plant: p, its unstable
/// pole; q, its fastest pole, the motors' back-EMF; U, the u that holds a radian of lean; a, the wheel's
/// acceleration under a held lean of one radian.
struct MipSlcDesign {
  double gain_U = 31.1;
  double integral_p = 1.78;
  double lead_q = 1.083;
  double roll_off_rad_s = 217.0;
  double outer_gain_pp_a = 0.01504;  // of p^2/a
  double outer_zero_p = 0.1477;
  double outer_pole_p = 3.32;
  double outer_roll_off_rad_s = 76.8;
};

/// Bryson's rule: a weight is 1 / (deviation worth one unit of u)^2.
struct MipLqrDesign {
  double theta_rad = 0.05;
  double phi_rad = 5.0;
  double theta_dot_rad_s = 8.0;
  double phi_dot_rad_s = 60.0;
  double u_x = 1.0;
};

struct MipYawDesign {
  double psi_rad = 1.0;
  double psi_dot_rad_s = 20.0;
  double u_z = 1.0;
};

struct MipDesignParams {
  MipSlcDesign slc;
  MipLqrDesign lqr;
  MipYawDesign yaw;
  double input_delay_s = 0.0;  // from the tick to the torque
};

/// (theta, phi, theta', phi') and u_x about upright at a constant yaw rate.
struct MipLinear {
  CMatrix A;
  CMatrix b;
};
MipLinear mip_linear(const MipParameters& p, double yaw_rate_rad_s);

/// As published with the robot's library, for 100 Hz. [T] (3.50)-(3.51) print these with three digits and
/// D2's sign reversed, and are unstable so.
inline constexpr double kMipPublishedHz = 100.0;
inline constexpr SecondOrder kMipPublishedD1{-4.945, 8.862, -3.967, -1.481, 0.4812};
inline constexpr SecondOrder kMipPublishedD2{0.18856, -0.37209, 0.18354, -1.86046, 0.86046};

/// What keeps this robot from being balanced, if anything; `wheel_torque_N_m`: of one stalled motor.
std::optional<DesignProblem> design_problem(const MipParameters& p, const MipDesignParams& d,
                                            double wheel_torque_N_m);

/// The same of successive loop closure, which only who chooses it needs.
std::optional<DesignProblem> slc_problem(const MipParameters& p, const MipDesignParams& d,
                                         const MipSlcGains& g);

/// Acceleration whose lean takes a third of the tilt that the full torque can bring back.
double feasible_acceleration_m_s2(const MipParameters& p);
/// And with which that lean comes no faster than the robot falls.
double feasible_jerk_m_s3(const MipParameters& p);

/// What a command may ask of a wheel in steady motion.
struct MipWheelBudget {
  double duty_share = 1.0;
  double max_rate_rad_s = 1e9;
};

/// What steady motion takes of each wheel's duty, and may take: a wheel's rate is duty against its back-EMF.
/// `friction_share`: of Coulomb friction that is compensated.
DutyBudget mip_duty_budget(const MipParameters& p, const MipWheelBudget& wheel, double friction_share);

MipGains design_mip(const MipParameters& p, const MipDesignParams& d);

}  // namespace equipoise
