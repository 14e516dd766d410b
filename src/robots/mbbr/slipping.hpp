// The MBBR where contacts carry only so much: its ball may slide and spin on the floor and its wheels slip on
// the ball, so it has eight velocities where rolling leaves five, and three of the rotors. In: motion, loads,
// friction limits -> out: what the floor must carry; what all contacts and friction do carry; accelerations
// under that. Same conventions as dynamics.hpp. Simulation only; deterministic, no allocation.
#pragma once

#include <Eigen/Cholesky>

#include "robots/mbbr/dynamics.hpp"

namespace equipoise {

struct MbbrFloorParams {
  double grip = 0.0;              // friction coefficient ball on floor; 0: holds anything
  double torsion_radius_m = 0.0;  // of the contact: about the vertical it carries grip x load x radius
};

/// Floor on ball, yaw frame.
struct MbbrFloorForce {
  Vec2 force_star_N = Vec2::Zero();
  double torsion_N_m = 0.0;
  double normal_N = 0.0;
};

/// Of body (body axes), ball (yaw frame) and the ball's centre (yaw frame), inertial.
struct MbbrSlipAccelerations {
  Vec3 omega_dot_B = Vec3::Zero();
  Vec3 ball_dot = Vec3::Zero();
  Vec2 centre_star = Vec2::Zero();
};

/// The rotors with gears and wheels, over one step, each at its wheel; `axes_B`: torque on the ball per
/// torque of each contact.
struct MbbrRotors {
  bool loose = true;  // else they turn with the ball, and are of its mass
  Mat3 axes_B = Mat3::Identity();
  Vec3 free_rad_s = Vec3::Zero();  // rates at its end if nothing rubbed
  Vec3 compliance = Vec3::Zero();  // what a torque over it adds to them, rad/s per N m
  Vec3 gear_N_m = Vec3::Zero();    // friction before the contacts, at most
  Vec3 grip_N_m = Vec3::Zero();    // what the contacts carry, at most
};

/// Torques and forces of one step.
struct MbbrFriction {
  Vec3 axes_B = Vec3::Zero();       // friction beyond the contacts
  Vec3 wheels = Vec3::Zero();       // of the contacts, at the wheels
  Vec3 rotor_rad_s = Vec3::Zero();  // at its end
  MbbrFloorForce floor;
  bool holds = true;  // all within what they carry: at the end of the step everything rolls
};

constexpr double kNeverGivesWay = 1e9;  // of a contact without limit; N, N m

struct MbbrFloorLimits {
  double force_N = 0.0;
  double torsion_N_m = 0.0;
  double normal_N = 0.0;
};

/// Friction about the axes (at most `limit_B`), of wheels and floor that bring relative rates, slip and spin
/// to rest within a step, as far as they may. `free`: what they would be without; `response`: what the same
/// torques and forces add to them.
MbbrFriction contact_friction(const Mat<6, 6>& response, const Vec<6>& free, const Vec3& limit_B,
                              const MbbrRotors& rotors, const MbbrFloorLimits& floor) noexcept;

class MbbrSlipping {
 public:
  using Mass = Eigen::LLT<Mat<8, 8>>;

  MbbrSlipping(const MbbrParameters& robot, const MbbrFloorParams& floor) noexcept
      : p_(robot), floor_(floor) {}

  bool limited() const noexcept { return floor_.grip > 0.0; }
  bool carries(const MbbrFloorForce& needed) const noexcept;

  /// What keeps the ball rolling without spin under these loads.
  MbbrFloorForce needed(const MbbrMotion& m, const MbbrLoads& loads,
                        const MbbrAccelerations& a) const noexcept;

  Mass mass(const MbbrMotion& m) const noexcept;
  MbbrSlipAccelerations accelerations(const MbbrMotion& m, const Mass& mass, const MbbrLoads& loads,
                                      const MbbrFloorForce& floor) const noexcept;

  /// The same of a step of this robot under `normal_N`.
  MbbrFriction friction(const MbbrMotion& m, const Mass& mass, const Vec<6>& free, double step_s,
                        const Vec3& limit_B, const MbbrRotors& rotors, double normal_N) const noexcept;

 private:
  MbbrParameters p_;
  MbbrFloorParams floor_;
};

/// The same as accelerations of a rolling ball: what an accelerometer feels depends on the centre alone.
MbbrAccelerations felt_as_rolling(const MbbrSlipAccelerations& a, double ball_radius_m) noexcept;

}  // namespace equipoise
