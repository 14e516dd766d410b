#include "robots/lanes/roll.hpp"

#include <cstring>

namespace equipoise {

using Roll = void(MbbrRollingOf<double>* const*, int, BridgeType, int, double) noexcept;
namespace baseline {
Roll roll;
}
#ifdef EQUIPOISE_X86_LANES
namespace avx2 {
Roll roll;
}
namespace avx512 {
Roll roll;
}
#endif

namespace {

struct Choice {
  const char* name;
  Roll* roll;
  bool here;  // on this processor
};

/// The widest first.
const auto& choices() noexcept {
#ifdef EQUIPOISE_X86_LANES
  static const std::array<Choice, 3> all{{{"avx512", avx512::roll, __builtin_cpu_supports("avx512f") != 0},
                                          {"avx2", avx2::roll, __builtin_cpu_supports("avx2") != 0},
                                          {"baseline", baseline::roll, true}}};
#else
  static const std::array<Choice, 1> all{{{"baseline", baseline::roll, true}}};
#endif
  return all;
}

}  // namespace

void roll_together(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept {
  for (const Choice& choice : choices()) {
    if (!choice.here) continue;
    choice.roll(robots, count, type, steps, h);
    return;
  }
}

bool roll_together_by(const char* isa, MbbrRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept {
  for (const Choice& choice : choices()) {
    if (std::strcmp(choice.name, isa) != 0 || !choice.here) continue;
    choice.roll(robots, count, type, steps, h);
    return true;
  }
  return false;
}

}  // namespace equipoise
