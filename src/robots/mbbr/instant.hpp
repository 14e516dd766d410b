// One instant of an MBBR whose ball rolls: where it is, the forces, what they do. In: state, dynamics, drive
// with its motors, loads -> out: accelerations, derivative of the state. Simulation only; no allocation.
#pragma once

#include "robots/mbbr/drive.hpp"
#include "robots/mbbr/dynamics.hpp"

namespace equipoise {

/// Attitude, body rates, ball rates (yaw frame), ball angles (inertial, of its centre's path), relative ball
/// angle, slip of the floor contact (yaw frame, m/s), spin; 3 + 3 + 2 + 2 + 3 + 2 + 1. The last three are
/// zero while the ball rolls.
using MbbrState = Vec<16>;
namespace mbbr_at {
enum : int { kTheta = 0, kOmega = 3, kPhiDot = 6, kPhi = 8, kRelative = 10, kSlip = 13, kSpin = 15 };
}

/// Where a robot is and how it moves.
struct MbbrHere {
  explicit MbbrHere(const MbbrState& s) noexcept
      : motion(s.segment<2>(mbbr_at::kTheta), s.segment<3>(mbbr_at::kOmega), s.segment<2>(mbbr_at::kPhiDot)),
        heading(s(mbbr_at::kTheta + 2)) {
    turn(s);
  }
  /// Within a step from `before`, turned by `by_rad` since.
  MbbrHere(const MbbrHere& before, const MbbrState& s, double by_rad) noexcept
      : motion(before.motion, s.segment<2>(mbbr_at::kTheta), s.segment<3>(mbbr_at::kOmega),
               s.segment<2>(mbbr_at::kPhiDot)),
        heading(before.heading.near(s(mbbr_at::kTheta + 2), by_rad)) {
    turn(s);
  }

  MbbrMotion motion;
  Turn heading;
  Vec3 relative_B;  // rate of the ball against the body

 private:
  void turn(const MbbrState& s) noexcept {
    motion.spin_rad_s = s(mbbr_at::kSpin);
    relative_B = MbbrDynamics::encoder_rate_B(motion);
  }
};

/// The forces there and what they do.
struct MbbrInstant : MbbrHere {
  explicit MbbrInstant(const MbbrHere& here) noexcept : MbbrHere(here) {}

  /// Motors, gears and friction; `viscous`: N m s.
  void driven(const MbbrDrive& drive, const MbbrDrive::Motors& motors, double viscous,
              const Vec3& friction_B) noexcept {
    viscous_B = -viscous * relative_B;
    wheel_torque = drive.wheel_torques(motors, relative_B);
    loads.tau_B = drive.torque_B(wheel_torque, viscous_B + friction_B);
  }
  /// Under the loads that are known by now.
  void roll(const MbbrDynamics& dynamics) noexcept {
    mass = dynamics.mass(motion);
    a = dynamics.accelerations(motion, mass, loads);
  }
  /// The same with friction: forces and mass matrix are known, the accelerations linear in the torque.
  MbbrInstant with_friction(const MbbrDynamics& dynamics, const MbbrDrive& drive,
                            const Vec3& friction_B) const noexcept {
    MbbrInstant now = *this;
    now.loads.tau_B = drive.torque_B(wheel_torque, viscous_B + friction_B);
    const MbbrAccelerations more = dynamics.response(motion, mass, now.loads.tau_B - loads.tau_B);
    now.a.omega_dot_B += more.omega_dot_B;
    now.a.phi_ddot_inertial += more.phi_ddot_inertial;
    return now;
  }
  MbbrState derivative(const MbbrDrive& drive) const noexcept {
    MbbrState d;
    const Vec3 theta_dot = motion.theta_dot();
    d.segment<3>(mbbr_at::kTheta) = theta_dot;
    d.segment<3>(mbbr_at::kOmega) = a.omega_dot_B;
    d.segment<2>(mbbr_at::kPhiDot) = MbbrDynamics::phi_star_ddot(motion, a, theta_dot.z());
    d.segment<2>(mbbr_at::kPhi) = heading(motion.phi_dot_star);
    d.segment<3>(mbbr_at::kRelative) = drive.seen_rate_B(relative_B);
    d.segment<3>(mbbr_at::kSlip).setZero();
    return d;
  }
  /// Relative rates that a step of `h` seconds would end with.
  Vec3 relative_after(double h) const noexcept {
    const Vec3 theta_dot = motion.theta_dot();
    const MbbrMotion next(motion, motion.theta_xy() + h * theta_dot.head<2>(),
                          motion.omega_B + h * a.omega_dot_B,
                          motion.phi_dot_star + h * MbbrDynamics::phi_star_ddot(motion, a, theta_dot.z()));
    return MbbrDynamics::encoder_rate_B(next);
  }

  Vec3 wheel_torque;
  Vec3 viscous_B;
  MbbrLoads loads;
  MbbrMass mass;
  MbbrAccelerations a;
};

}  // namespace equipoise
