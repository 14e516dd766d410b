// The two-wheel inverted pendulum (eduMIP): dimensions, inertias, wheel maps.
// Source: [T] Table 3.2; values come from config/edumip.toml.
// Frames: body x left, y back, z up; theta about x, psi about z; phi is the mean encoder angle (wheel to
// body). RT-safe after construction.
#pragma once

#include "equipoise/samples.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

/// Physical parameters, SI. Defaults: [T] Table 3.2.
struct MipParameters {
  double m_b = 0.218;     // body mass
  double m_w = 0.024;     // one wheel
  double r = 0.035;       // wheel radius
  double d = 0.070;       // distance between the wheels
  double l = 0.046;       // axle to body centre of mass
  double I_b1 = 5.91e-4;  // body inertia about its centre of mass
  double I_b2 = 2.99e-4;
  double I_b3 = 2.91e-4;
  double I_w1 = 6.42e-5;  // one wheel, about its axle
  double I_w2 = 7.48e-6;
  double I_w3 = 7.48e-6;
  double k1 = 0.12;   // torque per unit of u, one motor
  double k2 = 0.003;  // back-EMF, one motor
};

}  // namespace equipoise
