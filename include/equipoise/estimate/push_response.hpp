// What a push on the centre of mass changes in a tick. In: rates(lean_rad, u) -> accelerations (body,
// wheels or ball), rad/s2 -> out: change of (tilt rate, rate of wheels or ball), rad/s per N.
#pragma once

#include "equipoise/types.hpp"

namespace equipoise {

struct PushedBody {
  double m_kg, l_m, r_m;  // above the axle; rolling radius
  double stall_N_m;       // at u = 1, of all motors
};

/// Gravity turns the body by its weight, the motors turn body and wheels against each other. The force does
/// work on both: the centre of mass moves by r (theta + phi) + l theta.
template <class Rates>
Vec2 push_response(const PushedBody& body, const Rates& rates) {
  constexpr double kLeant_rad = 1e-6;
  const Vec2 on_body = rates(kLeant_rad, 0.0) / (kLeant_rad * body.m_kg * kGravity_m_s2 * body.l_m);
  const Vec2 on_wheels = rates(0.0, 1.0) / body.stall_N_m + on_body;
  return kTickS * (body.l_m * on_body + body.r_m * on_wheels);
}

}  // namespace equipoise
