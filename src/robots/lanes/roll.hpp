// Robots that roll, several at once in the processor's vector registers, by the widest instructions that it
// has. In: numbers of each, step -> out: their states after the steps, the same numbers as roll() gives one by
// one but for the last digits. What does not fit MbbrRollingOf steps its own world. Simulation only; no
// allocation.
#pragma once

#include "equipoise/plant/lanes.hpp"
#include "robots/mbbr/rolling.hpp"

namespace equipoise {

/// `robots`: 1 to kLanes of them; all have bridges of this type.
void roll_together(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept;

/// The same by one instruction set, for tests: "baseline", "avx2", "avx512"; false: this processor has it not.
bool roll_together_by(const char* isa, MbbrRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept;

}  // namespace equipoise
