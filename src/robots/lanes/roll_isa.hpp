// roll_together() for the instruction set that the including file is compiled for. EQUIPOISE_ISA names it:
// all code of the file carries the name, so that the linker cannot take it for that of another one.
// EQUIPOISE_LANES: doubles in one of its registers.
#pragma once

#define EIGEN_DONT_VECTORIZE  // the lanes are vectors already

#include <cstring>

#include "equipoise/plant/lanes.hpp"
#include "robots/lanes/roll.hpp"

namespace equipoise::EQUIPOISE_ISA {

struct Isa {
  static constexpr int kLanes = EQUIPOISE_LANES;
  using Vector = double __attribute__((vector_size(kLanes * sizeof(double))));
  using Bits = long long __attribute__((vector_size(kLanes * sizeof(double))));
  using Unsigned = unsigned long long __attribute__((vector_size(kLanes * sizeof(double))));
};
using Real = Lanes<Isa>;

/// Numbers of several robots to numbers side by side; the places that are left over repeat the first robot.
template <class One, class Many>
void gather(const One* const* robots, int count, Many* many) noexcept {
  constexpr std::size_t kNumbers = sizeof(One) / sizeof(double);
  static_assert(sizeof(Many) == Isa::kLanes * sizeof(One), "numbers alone");
  for (int lane = 0; lane < Isa::kLanes; ++lane) {
    const auto* from = reinterpret_cast<const char*>(robots[lane < count ? lane : 0]);
    auto* to = reinterpret_cast<char*>(many) + static_cast<std::size_t>(lane) * sizeof(double);
    for (std::size_t k = 0; k < kNumbers; ++k)
      std::memcpy(to + k * sizeof(Real), from + k * sizeof(double), sizeof(double));
  }
}

/// What the steps changed, back to each.
template <class Many, class One>
void scatter(const Many& many, int count, One* const* robots) noexcept {
  for (int lane = 0; lane < count; ++lane) {
    const auto* from = reinterpret_cast<const char*>(&many) + static_cast<std::size_t>(lane) * sizeof(double);
    auto* to = reinterpret_cast<char*>(robots[lane]);
    for (std::size_t k = 0; k < sizeof(One) / sizeof(double); ++k)
      std::memcpy(to + k * sizeof(double), from + k * sizeof(Real), sizeof(double));
  }
}

template <class Many, class One>
void roll_all(One* const* robots, int count, BridgeType type, int steps, double h) noexcept {
  Many many;
  for (int first = 0; first < count; first += Isa::kLanes) {
    const int here = count - first < Isa::kLanes ? count - first : Isa::kLanes;
    gather(robots + first, here, &many);
    equipoise::roll(&many, type, steps, h);
    scatter(many, here, robots + first);
  }
}

// Flat: what stays a function takes and gives its vectors through memory: two fifths more time.
[[gnu::flatten]] void roll(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                           double h) noexcept {
  roll_all<MbbrRollingOf<Real>>(robots, count, type, steps, h);
}
[[gnu::flatten]] void roll(MipRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                           double h) noexcept {
  roll_all<MipRollingOf<Real>>(robots, count, type, steps, h);
}

}  // namespace equipoise::EQUIPOISE_ISA
