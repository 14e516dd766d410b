// Whether a robot can be balanced by its motors at all, and which parameter looks wrong when it cannot.
// In: linear model, parameters -> out: what is wrong, if anything. Start-up only.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "equipoise/control/riccati.hpp"

namespace equipoise {

struct DesignProblem {
  std::string parameter;  // key of [robot]; empty: the weights and delays of the design
  std::string why;
};

/// Rate of the fastest unstable mode of x' = A x + b u, and the value of state `i` alone from which |u| = 1
/// can still bring it back.
struct Recoverable {
  double pole_rad_s = 0.0;
  double limit = 0.0;
};
Recoverable recoverable(const CMatrix& A, const CMatrix& b, Eigen::Index i);

/// The first check that fails: `value` outside [low, high].
std::optional<DesignProblem> outside(const std::string& parameter, const std::string& what, double value,
                                     double low, double high);

/// Motors too weak, or a fall too fast, for a robot whose state `i` is the tilt.
std::optional<DesignProblem> beyond_recovery(const CMatrix& A, const CMatrix& b, Eigen::Index i);
/// Too little phase or delay margin of the full-state loop broken at u, or no stability.
std::optional<DesignProblem> without_margin(const SampledSystem& loop, const CMatrix& K);
/// The same under u = -K(z) (x, u before); `pole`: the closed loop's largest.
std::optional<DesignProblem> without_margin(const SampledSystem& loop, double pole,
                                            const std::function<CMatrix(Complex z)>& K);

/// A model whose fastest mode, 1/s, the filters' step of 5 ms (Heun's) cannot follow. `parameter`: its keys.
std::optional<DesignProblem> too_fast_for_the_tick(const std::string& parameter, const CMatrix& A);

}  // namespace equipoise
