// The parts of a replay: what of two records differs, what counts, what is judged. In: records -> out: the
// first difference, sums. For replay.cpp and its tests.
#pragma once

#include "app/log/replay.hpp"

namespace equipoise::app {

/// The first number that differs: bit for bit, but any NaN is any other.
void compare(const runtime::TickRecord& logged, const runtime::TickRecord& replayed, Difference* difference);

/// One tick of both into the comparison.
void compare_tunings(const runtime::TickRecord& recorded, const runtime::TickRecord& retuned, Retuned* out);

/// As the run judged it.
VerdictJudge::Tick judged(const runtime::TickRecord& r) noexcept;

/// What counts, as in sim: from the fifth second on; simulated clocks start at 0.
bool settled(const runtime::TickRecord& r) noexcept;

}  // namespace equipoise::app
