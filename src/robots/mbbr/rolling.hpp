// One instant of an MBBR whose ball rolls: forces, accelerations, derivative, friction of a step. Real:
// double or Lanes. In: state, dynamics, drive, loads -> out: derivative of the state. `Drive` says what
// motors and wheels do: wheel_torques(relative rate), torque_B(wheel torque, friction), seen_rate_B(relative
// rate), all as MbbrDrive. Simulation only; no allocation.
#pragma once

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/integrator.hpp"
#include "equipoise/plant/motors.hpp"
#include "robots/mbbr/dynamics.hpp"

namespace equipoise {

/// Attitude, body rates, ball rates (yaw frame), ball angles (inertial, of its centre's path), relative ball
/// angle, slip of the floor contact (yaw frame, m/s), spin; 3 + 3 + 2 + 2 + 3 + 2 + 1. The last three are
/// zero while the ball rolls.
template <class Real>
using MbbrStateOf = VecOf<Real, 16>;
namespace mbbr_at {
enum : int { kTheta = 0, kOmega = 3, kPhiDot = 6, kPhi = 8, kRelative = 10, kSlip = 13, kSpin = 15 };
}

/// Where a robot is and how it moves.
template <class Real>
struct MbbrHereOf {
  using State = MbbrStateOf<Real>;

  explicit MbbrHereOf(const State& s) noexcept
      : motion(s.template segment<2>(mbbr_at::kTheta), s.template segment<3>(mbbr_at::kOmega),
               s.template segment<2>(mbbr_at::kPhiDot)),
        heading(s(mbbr_at::kTheta + 2)) {
    turn(s);
  }
  /// Within a step from `before`, turned by `by_rad` since.
  MbbrHereOf(const MbbrHereOf& before, const State& s, const Real& by_rad) noexcept
      : motion(before.motion, s.template segment<2>(mbbr_at::kTheta), s.template segment<3>(mbbr_at::kOmega),
               s.template segment<2>(mbbr_at::kPhiDot)),
        heading(before.heading.near(s(mbbr_at::kTheta + 2), by_rad)) {
    turn(s);
  }

  MbbrMotionOf<Real> motion;
  TurnOf<Real> heading;
  VecOf<Real, 3> relative_B;  // rate of the ball against the body

 private:
  void turn(const State& s) noexcept {
    motion.spin_rad_s = s(mbbr_at::kSpin);
    relative_B = MbbrDynamicsOf<Real>::encoder_rate_B(motion);
  }
};

/// The forces there and what they do.
template <class Real>
struct MbbrInstantOf : MbbrHereOf<Real> {
  using Here = MbbrHereOf<Real>;
  using State = MbbrStateOf<Real>;
  using V3 = VecOf<Real, 3>;
  using Here::heading;
  using Here::motion;
  using Here::relative_B;

  explicit MbbrInstantOf(const Here& here) noexcept : Here(here) {}

  /// Motors, gears and friction; `viscous`: N m s.
  template <class Drive>
  void drive(const Drive& wheels, const Real& viscous, const V3& friction_B) noexcept {
    viscous_B = -viscous * relative_B;
    wheel_torque = wheels.wheel_torques(relative_B);
    loads.tau_B = wheels.torque_B(wheel_torque, viscous_B + friction_B);
  }
  /// Under the loads that are known by now.
  void roll(const MbbrDynamicsOf<Real>& dynamics) noexcept {
    mass = dynamics.mass(motion);
    a = dynamics.accelerations(motion, mass, loads);
  }
  /// The same with friction: forces and mass matrix are known, the accelerations linear in the torque.
  template <class Drive>
  MbbrInstantOf with_friction(const MbbrDynamicsOf<Real>& dynamics, const Drive& wheels,
                              const V3& friction_B) const noexcept {
    MbbrInstantOf now = *this;
    now.loads.tau_B = wheels.torque_B(wheel_torque, viscous_B + friction_B);
    const MbbrAccelerationsOf<Real> more = dynamics.response(motion, mass, now.loads.tau_B - loads.tau_B);
    now.a.omega_dot_B += more.omega_dot_B;
    now.a.phi_ddot_inertial += more.phi_ddot_inertial;
    return now;
  }
  template <class Drive>
  State derivative(const Drive& wheels) const noexcept {
    State d;
    const V3 theta_dot = motion.theta_dot();
    d.template segment<3>(mbbr_at::kTheta) = theta_dot;
    d.template segment<3>(mbbr_at::kOmega) = a.omega_dot_B;
    d.template segment<2>(mbbr_at::kPhiDot) = MbbrDynamicsOf<Real>::phi_star_ddot(motion, a, theta_dot.z());
    d.template segment<2>(mbbr_at::kPhi) = heading(motion.phi_dot_star);
    d.template segment<3>(mbbr_at::kRelative) = wheels.seen_rate_B(relative_B);
    d.template segment<3>(mbbr_at::kSlip).setZero();
    return d;
  }
  /// Relative rates that a step of `h` seconds would end with.
  V3 relative_after(double h) const noexcept {
    const V3 theta_dot = motion.theta_dot();
    const MbbrMotionOf<Real> next(
        motion, motion.theta_xy() + h * theta_dot.template head<2>(), motion.omega_B + h * a.omega_dot_B,
        motion.phi_dot_star + h * MbbrDynamicsOf<Real>::phi_star_ddot(motion, a, theta_dot.z()));
    return MbbrDynamicsOf<Real>::encoder_rate_B(next);
  }

  V3 wheel_torque;
  V3 viscous_B;
  MbbrLoadsOf<Real> loads;
  MbbrMassOf<Real> mass;
  MbbrAccelerationsOf<Real> a;
};

/// Coulomb friction about the body axes at these relative rates, at most; `yaw_scale`: for positive and for
/// negative spin of the ball in the body.
template <class Real>
VecOf<Real, 3> sliding_friction_N_m(const Real& coulomb_N_m, const Real& yaw_positive,
                                    const Real& yaw_negative,
                                    const VecOf<Real, 3>& relative_rate_B) noexcept {
  VecOf<Real, 3> limit = VecOf<Real, 3>::Constant(coulomb_N_m);
  limit.z() *= select(relative_rate_B.z() >= 0.0, yaw_positive, yaw_negative);
  return limit;
}

/// A robot that rolls on a level floor, untouched, with three even motors and wheels as drawn: what its next
/// ticks depend on. Numbers alone, so that those of several robots can lie side by side.
template <class Real>
struct MbbrRollingOf {
  Real state[16];
  MbbrBodiesOf<Real> bodies;
  Real mobility[3];
  Real viscous_N_m_s, coulomb_N_m, yaw_positive, yaw_negative;
  Real ratio;    // r / r_w
  Real T_ob[9];  // columns: the wheels' axes
  BridgesOf<Real, Mbbr::kWheels> bridges;
  SupplyOf<Real, Mbbr::kWheels> supply;
  Real duty[Mbbr::kWheels];  // as commanded
  Real specific_force_B[3];  // m/s^2, at the IMU at the end of the ticks
};

/// Its drive.
template <class Real>
class MbbrEvenDriveOf {
 public:
  using V3 = VecOf<Real, 3>;

  MbbrEvenDriveOf(const MbbrRollingOf<Real>& robot, BridgeType type) noexcept
      : robot_(robot), type_(type), T_ob_(Eigen::Map<const MatOf<Real, 3, 3>>(robot.T_ob)) {}

  V3 wheel_torques(const V3& relative_rate_B) const noexcept {
    return robot_.bridges.torque(type_, wheel_rates(relative_rate_B));
  }
  V3 wheel_rates(const V3& relative_rate_B) const noexcept {
    return wheels_from_ball<Real>(robot_.ratio, T_ob_, relative_rate_B);
  }
  V3 torque_B(const V3& wheel_torque, const V3& friction_B) const noexcept {
    return axes_from_wheels<Real>(robot_.ratio, T_ob_, wheel_torque) + friction_B;
  }
  V3 seen_rate_B(const V3& relative_rate_B) const noexcept { return relative_rate_B; }

 private:
  const MbbrRollingOf<Real>& robot_;
  BridgeType type_;
  MatOf<Real, 3, 3> T_ob_;
};

/// A tick's steps of `h` seconds, as MbbrWorld::step() where nothing of what it may have is on.
template <class Real>
void roll(MbbrRollingOf<Real>* robot, BridgeType type, int steps, double h) noexcept {
  using Instant = MbbrInstantOf<Real>;
  using State = MbbrStateOf<Real>;
  const MbbrDynamicsOf<Real> dynamics(robot->bodies);
  const MbbrEvenDriveOf<Real> drive(*robot, type);
  const VecOf<Real, 3> none = VecOf<Real, 3>::Zero();
  const VecOf<Real, 3> mobility = Eigen::Map<const VecOf<Real, 3>>(robot->mobility);
  State s = Eigen::Map<const State>(robot->state);
  MbbrHereOf<Real> here(s);
  VecOf<Real, 3> friction;
  const auto rubbed = [&] {
    Instant free(here);
    free.drive(drive, robot->viscous_N_m_s, none);
    free.roll(dynamics);
    friction = uncoupled_coulomb_torque<Real, 3>(
        free.relative_after(h), mobility, h,
        sliding_friction_N_m(robot->coulomb_N_m, robot->yaw_positive, robot->yaw_negative, free.relative_B));
    return free.with_friction(dynamics, drive, friction);
  };
  for (int i = 0; i < steps; ++i) {
    const Instant now = rubbed();
    const State next = rk4_step(s, State(now.derivative(drive)), h, [&](const State& at) {
      Instant then(MbbrHereOf<Real>(here, at, at(mbbr_at::kTheta + 2) - s(mbbr_at::kTheta + 2)));
      then.drive(drive, robot->viscous_N_m_s, friction);
      then.roll(dynamics);
      return State(then.derivative(drive));
    });
    here = MbbrHereOf<Real>(here, next, next(mbbr_at::kTheta + 2) - s(mbbr_at::kTheta + 2));
    s = next;
  }
  Eigen::Map<State>(robot->state) = s;
  robot->supply.draw(robot->duty, drive.wheel_rates(here.relative_B), &robot->bridges);
  const Instant then = rubbed();
  Eigen::Map<VecOf<Real, 3>>(robot->specific_force_B) = -dynamics.accelerometer_B(then.motion, then.a);
}

}  // namespace equipoise
