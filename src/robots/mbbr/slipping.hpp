// The MBBR on a floor that carries only so much: its ball may slide and spin, so it has eight velocities
// where rolling leaves five. In: motion, loads, friction limits -> out: what the floor must carry;
// accelerations under what it does carry. Same conventions as dynamics.hpp. Simulation only; deterministic,
// no allocation.
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

/// Friction of one step: about the body axes, and the floor's.
struct MbbrFriction {
  Vec3 axes_B = Vec3::Zero();
  MbbrFloorForce floor;
  bool floor_holds = true;  // within what it carries: the ball rolls at the end of the step
};

class MbbrSlipping {
 public:
  using Velocities = Vec<8>;  // body, ball, ball's centre
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

  /// Friction about the axes (at most `limit_B`) and of the floor (under `normal_N`) that bring relative
  /// rates, slip and spin to rest within the step, as far as they may; `free`: what they would be without.
  MbbrFriction friction(const MbbrMotion& m, const Mass& mass, const Vec<6>& free, double step_s,
                        const Vec3& limit_B, double normal_N) const noexcept;

 private:
  MbbrParameters p_;
  MbbrFloorParams floor_;
};

/// The same as accelerations of a rolling ball: what an accelerometer feels depends on the centre alone.
MbbrAccelerations felt_as_rolling(const MbbrSlipAccelerations& a, double ball_radius_m) noexcept;

}  // namespace equipoise
