#include "robots/lanes/roll.hpp"

#include <array>
#include <cstring>

namespace equipoise {

template <class Robot>
using Roll = void(Robot* const*, int, BridgeType, int, double) noexcept;
namespace baseline {
Roll<MbbrRollingOf<double>> roll;
Roll<MipRollingOf<double>> roll;
}  // namespace baseline
#ifdef EQUIPOISE_X86_LANES
namespace avx2 {
Roll<MbbrRollingOf<double>> roll;
Roll<MipRollingOf<double>> roll;
}  // namespace avx2
namespace avx512 {
Roll<MbbrRollingOf<double>> roll;
Roll<MipRollingOf<double>> roll;
}  // namespace avx512
#endif

namespace {

template <class Robot>
struct Choice {
  const char* name;
  Roll<Robot>* roll;
  bool here;  // on this processor
};

/// The widest first.
template <class Robot>
const auto& choices() noexcept {
#ifdef EQUIPOISE_X86_LANES
  static const std::array<Choice<Robot>, 3> all{
      {{"avx512", avx512::roll, __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")},
       {"avx2", avx2::roll, __builtin_cpu_supports("avx2") != 0},
       {"baseline", baseline::roll, true}}};
#else
  static const std::array<Choice<Robot>, 1> all{{{"baseline", baseline::roll, true}}};
#endif
  return all;
}

template <class Robot>
void roll_widest(Robot* const* robots, int count, BridgeType type, int steps, double h) noexcept {
  for (const Choice<Robot>& choice : choices<Robot>()) {
    if (!choice.here) continue;
    choice.roll(robots, count, type, steps, h);
    return;
  }
}

template <class Robot>
bool roll_by(const char* isa, Robot* const* robots, int count, BridgeType type, int steps,
             double h) noexcept {
  for (const Choice<Robot>& choice : choices<Robot>()) {
    if (std::strcmp(choice.name, isa) != 0 || !choice.here) continue;
    choice.roll(robots, count, type, steps, h);
    return true;
  }
  return false;
}

}  // namespace

void roll_together(MbbrRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept {
  roll_widest(robots, count, type, steps, h);
}
void roll_together(MipRollingOf<double>* const* robots, int count, BridgeType type, int steps,
                   double h) noexcept {
  roll_widest(robots, count, type, steps, h);
}

bool roll_together_by(const char* isa, MbbrRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept {
  return roll_by(isa, robots, count, type, steps, h);
}
bool roll_together_by(const char* isa, MipRollingOf<double>* const* robots, int count, BridgeType type,
                      int steps, double h) noexcept {
  return roll_by(isa, robots, count, type, steps, h);
}

}  // namespace equipoise
