// One step of a MIP: gears, friction, Runge-Kutta. Real: double or Lanes. In: state, drivetrain, `Body` (the
// accelerations under wheel torques, and the speed of the axle) -> out: next state. Simulation only; no
// allocation.
#pragma once

#include "equipoise/plant/coulomb.hpp"
#include "equipoise/plant/gear_play.hpp"
#include "equipoise/plant/integrator.hpp"
#include "equipoise/plant/motors.hpp"
#include "robots/mip/dynamics.hpp"

namespace equipoise {

/// theta, phi, psi, their rates, position in W.
template <class Real>
using MipStateOf = VecOf<Real, 8>;
namespace mip_at {
enum : int { kTheta, kPhi, kPsi, kThetaDot, kPhiDot, kPsiDot, kPosition };
}

/// Sines and cosines of a state, computed once per evaluation.
template <class Real>
struct MipFacingOf {
  using State = MipStateOf<Real>;

  explicit MipFacingOf(const State& s) noexcept : tilt(s(mip_at::kTheta)), heading(s(mip_at::kPsi)) {}
  /// Within a step from there.
  MipFacingOf(const MipFacingOf& before, const State& s, const State& from) noexcept
      : tilt(before.tilt.near(s(mip_at::kTheta), s(mip_at::kTheta) - from(mip_at::kTheta))),
        heading(before.heading.near(s(mip_at::kPsi), s(mip_at::kPsi) - from(mip_at::kPsi))) {}

  TurnOf<Real> tilt, heading;
};

/// What the next ticks of a MIP depend on that stands on a level floor, untouched. Numbers alone, so that
/// those of several robots can lie side by side.
template <class Real>
struct MipRollingOf {
  using V2 = VecOf<Real, 2>;
  using State = MipStateOf<Real>;

  V2 wheel_rates(const State& s) const noexcept {
    const Real& phi = s(mip_at::kPhiDot);
    const Real& psi = s(mip_at::kPsiDot);
    return {phi + yaw_to_wheel * psi, phi - yaw_to_wheel * psi};
  }
  /// Motor and viscous friction, as far as the teeth touch; `motor`: of each motor, nominal.
  V2 gear_torque(const V2& rate, const V2& motor) const noexcept {
    V2 tau;
    for (int i = 0; i < 2; ++i) tau(i) = (motor(i) * motor_gain[i] - viscous_N_m_s * rate(i)) * engaged[i];
    return tau;
  }

  Real state[8];
  MipBodiesOf<Real> bodies;
  Real yaw_to_wheel;
  Real viscous_N_m_s;   // of a wheel
  Real coulomb_N_m[2];  // of each wheel, at most
  Real motor_gain[2];   // torque of each motor over nominal
  Real mobility[4];     // of the wheels' encoder rates; symmetric
  GearPlayParamsOf<Real> gear;
  GearPlayOf<Real> gears[2];
  Real engaged[2];  // 1: teeth in contact
  BridgesOf<Real, Mip::kWheels> bridges;
};

/// On a level floor, untouched.
template <class Real>
struct MipLevelOf {
  VecOf<Real, 3> accelerations(const MipStateOf<Real>& s, const MipFacingOf<Real>& facing,
                               const VecOf<Real, 2>& wheel_torque) const noexcept {
    return dynamics.accelerations(
        {s(mip_at::kTheta), s(mip_at::kThetaDot), s(mip_at::kPhiDot), s(mip_at::kPsiDot)}, facing.tilt,
        wheel_torque.x() + wheel_torque.y(), wheel_torque.x() - wheel_torque.y());
  }
  /// Of the axle along the yaw frame's y axis, m/s.
  Real speed(const MipStateOf<Real>& s) const noexcept {
    return -dynamics.wheel_radius_m() * (s(mip_at::kPhiDot) + s(mip_at::kThetaDot));
  }

  MipDynamicsOf<Real> dynamics;
};

template <class Real, class Body>
MipStateOf<Real> derivative(const Body& body, const MipStateOf<Real>& s, const MipFacingOf<Real>& facing,
                            const VecOf<Real, 3>& accelerations) noexcept {
  MipStateOf<Real> d;
  d.template segment<3>(mip_at::kTheta) = s.template segment<3>(mip_at::kThetaDot);
  d.template segment<3>(mip_at::kThetaDot) = accelerations;
  d.template segment<2>(mip_at::kPosition) = facing.heading(VecOf<Real, 2>(Real(0.0), body.speed(s)));
  return d;
}

/// Coulomb friction of each wheel over a step of `h` seconds; `limit`: at most.
template <class Real, class Body>
VecOf<Real, 2> friction_torque(const MipRollingOf<Real>& robot, const Body& body, const MipStateOf<Real>& s,
                               const MipFacingOf<Real>& facing, const VecOf<Real, 2>& gear_torque,
                               const VecOf<Real, 2>& limit, double h) noexcept {
  const MipStateOf<Real> next =
      s + h * derivative(body, s, facing, body.accelerations(s, facing, gear_torque));
  const MatOf<Real, 2, 2> mobility = Eigen::Map<const MatOf<Real, 2, 2>>(robot.mobility);
  return coulomb_torque<Real, 2>(robot.wheel_rates(next), mobility, h, limit);
}

/// A step of `h` seconds, or a part of it, `part_h`: friction is that of the whole. `facing`: at its
/// beginning. `motors(rates)`: torque of each, nominal; `limit(rates)`: of friction;
/// `feel(accelerations)`: at its beginning.
template <class Real, class Body, class Motors, class Limit, class Feel>
void step(MipRollingOf<Real>* robot, const Body& body, const MipFacingOf<Real>& facing, double h,
          double part_h, Motors&& motors, Limit&& limit, Feel&& feel) noexcept {
  using State = MipStateOf<Real>;
  using V2 = VecOf<Real, 2>;
  const State s = Eigen::Map<const State>(robot->state);
  const V2 rates = robot->wheel_rates(s);
  const V2 crossing = motors(V2(rates + V2(robot->gears[0].rate_rad_s(), robot->gears[1].rate_rad_s())));
  for (int i = 0; i < 2; ++i) {  // the motor's side of each gear
    robot->engaged[i] = select(robot->gears[i].step(robot->gear, crossing(i), part_h), Real(1.0), Real(0.0));
  }
  const auto gear_torque = [&](const State& at) {
    const V2 rate = robot->wheel_rates(at);
    return robot->gear_torque(rate, motors(rate));
  };
  const V2 gear = gear_torque(s);
  const V2 friction = friction_torque<Real>(*robot, body, s, facing, gear, limit(rates), h);
  const VecOf<Real, 3> now = body.accelerations(s, facing, gear + friction);
  feel(now);
  Eigen::Map<State>(robot->state) =
      rk4_step(s, derivative(body, s, facing, now), part_h, [&](const State& at) {
        const MipFacingOf<Real> turned(facing, at, s);
        return derivative(body, at, turned, body.accelerations(at, turned, gear_torque(at) + friction));
      });
}

/// Steps of `h` seconds, as MipWorld::step() where nothing of what it may have is on.
template <class Real>
void roll(MipRollingOf<Real>* robot, BridgeType type, int steps, double h) noexcept {
  using V2 = VecOf<Real, 2>;
  const MipLevelOf<Real> level{MipDynamicsOf<Real>(robot->bodies)};
  using State = MipStateOf<Real>;
  State before = Eigen::Map<const State>(robot->state);
  MipFacingOf<Real> facing(before);
  for (int i = 0; i < steps; ++i) {
    step(
        robot, level, facing, h, h, [&](const V2& rates) { return robot->bridges.torque(type, rates); },
        [&](const V2&) { return V2(robot->coulomb_N_m[0], robot->coulomb_N_m[1]); },
        [](const VecOf<Real, 3>&) {});
    const State now = Eigen::Map<const State>(robot->state);
    facing = MipFacingOf<Real>(facing, now, before);
    before = now;
  }
}

}  // namespace equipoise
