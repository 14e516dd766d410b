// Robots that roll, several at once in the processor's vector registers, by the widest instructions that it
// has. In: numbers of each, step -> out: their states after the steps, the same numbers as roll() gives one
// by one but for the last digits. A robot that its Rolling does not describe is stepped by its own world.
// Simulation only; no allocation.
#pragma once

#include "robots/mbbr/rolling.hpp"
#include "robots/mip/rolling.hpp"

namespace equipoise {

/// At most; one does not fill a register.
inline constexpr int kRobotsTogether = 8;

/// `robots`: 1 to kRobotsTogether; all have bridges of this type.
void roll_together(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept;
void roll_together(MipRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept;

/// The same by one instruction set, for tests: "baseline", "avx2", "avx512"; false: this processor has it
/// not.
bool roll_together_by(const char* isa, MbbrRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept;
bool roll_together_by(const char* isa, MipRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept;

}  // namespace equipoise
