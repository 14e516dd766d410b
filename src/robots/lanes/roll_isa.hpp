// roll_together() for the instruction set that the including file is compiled for. EQUIPOISE_ISA names it: all
// code of the file carries the name, so that the linker cannot take it for that of another one.
#pragma once

#define EIGEN_DONT_VECTORIZE  // the lanes are vectors already

#include <cstring>

#include "equipoise/plant/lanes.hpp"
#include "robots/lanes/roll.hpp"

namespace equipoise::EQUIPOISE_ISA {

struct Isa {};
using Real = Lanes<Isa>;

/// Numbers of several robots to numbers side by side; the places that are left over repeat the first robot.
template <class One, class Many>
void gather(const One* const* robots, int count, Many* many) noexcept {
  constexpr std::size_t kNumbers = sizeof(One) / sizeof(double);
  static_assert(sizeof(Many) == kLanes * sizeof(One), "numbers alone");
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto* from = reinterpret_cast<const char*>(robots[lane < count ? lane : 0]);
    auto* to = reinterpret_cast<char*>(many) + static_cast<std::size_t>(lane) * sizeof(double);
    for (std::size_t k = 0; k < kNumbers; ++k)
      std::memcpy(to + k * sizeof(Real), from + k * sizeof(double), sizeof(double));
  }
}

void roll(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps, double h) noexcept {
  MbbrRollingOf<Real> many;
  gather(robots, count, &many);
  equipoise::roll(&many, type, steps, h);
  for (int lane = 0; lane < count; ++lane) {
    for (std::size_t k = 0; k < 16; ++k) robots[lane]->state[k] = many.state[k][lane];
  }
}

}  // namespace equipoise::EQUIPOISE_ISA
