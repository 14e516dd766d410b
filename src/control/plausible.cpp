#include "equipoise/control/plausible.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "equipoise/control/margins.hpp"
#include "equipoise/types.hpp"

namespace equipoise {
namespace {

// Start refuses below these, with the loop of the full state broken at u: filter and delays, which `design`
// measures and the target has no time for, then take all of it. The shipped designs are held to more by
// tests.
constexpr double kLeastPhase_deg = 30.0;
constexpr double kLeastDelay_s = 0.8 * kTickS;
constexpr double kLeastTilt_rad = 0.04;  // full torque brings it back
constexpr double kFastestFall_1_s =
    25.0;  // e-fold in 40 ms: two thirds of it by the time eight ticks have gone

// Heun's step multiplies a mode of rate a by 1 - aT + (aT)^2/2, which is at its least, and so farthest from
// exp(-aT) for its size, at aT = 1; beyond 2 it grows.
constexpr double kFastestMode_1_s = 1.0 / kTickS;

Margins margins_at_input(const SampledSystem& system, const std::function<CMatrix(Complex z)>& feedback) {
  const Eigen::Index n = system.A.rows();
  const std::vector<double> omega = frequency_grid(kTickS, 120, 0.0);
  std::vector<Complex> L;
  L.reserve(omega.size());
  for (const double w : omega) {
    const Complex z = std::polar(1.0, w * kTickS);
    const CMatrix x =
        (z * CMatrix::Identity(n, n) - system.A).partialPivLu().solve(system.B + system.B_late / z);
    const CMatrix K = feedback(z);
    L.push_back((K.leftCols(n) * x)(0, 0) / (1.0 + K(0, n) / z));
  }
  return margins(omega, L, 0.0);
}

}  // namespace

Recoverable recoverable(const CMatrix& A, const CMatrix& b, Eigen::Index i) {
  // w' A = pole w': w'x is the amount of the unstable mode, which u can move by at most |w'b| / pole.
  const Eigen::ComplexEigenSolver<CMatrix> left(A.transpose());
  Eigen::Index mode = 0;
  left.eigenvalues().real().maxCoeff(&mode);
  const Eigen::VectorXcd w = left.eigenvectors().col(mode);
  const double pole = left.eigenvalues()(mode).real();
  return {pole, std::abs((w.transpose() * b)(0, 0)) / (pole * std::abs(w(i)))};
}

std::optional<DesignProblem> outside(const std::string& parameter, const std::string& what, double value,
                                     double low, double high) {
  if (value >= low && value <= high) return std::nullopt;
  return DesignProblem{parameter, "implausible: " + what + " is " + std::to_string(value) +
                                      "; allowed: " + std::to_string(low) + " to " + std::to_string(high)};
}

std::optional<DesignProblem> beyond_recovery(const CMatrix& A, const CMatrix& b, Eigen::Index i) {
  const Recoverable r = recoverable(A, b, i);
  if (auto bad = outside("com_height_m, body_mass_kg or k1_N_m",
                         "tilt that the full torque can bring back, rad", r.limit, kLeastTilt_rad, 100.0))
    return bad;
  return outside("com_height_m", "rate of falling, 1/s", r.pole_rad_s, 0.0, kFastestFall_1_s);
}

std::optional<DesignProblem> without_margin(const SampledSystem& loop, double pole,
                                            const std::function<CMatrix(Complex z)>& K) {
  if (!(pole < 1.0)) return DesignProblem{"", "no gain stabilises this robot"};
  const Margins m = margins_at_input(loop, K);
  if (auto bad = outside("", "phase margin, degrees,", m.phase_deg, kLeastPhase_deg, 181.0)) return bad;
  return outside("", "delay margin, s,", m.delay_s, kLeastDelay_s, 1e9);
}

std::optional<DesignProblem> without_margin(const SampledSystem& loop, const CMatrix& K) {
  return without_margin(loop, largest_pole(loop, K), [&K](Complex) { return K; });
}

std::optional<DesignProblem> too_fast_for_the_tick(const std::string& parameter, const CMatrix& A) {
  return outside(parameter, "fastest mode of the model, 1/s,", eigenvalues(A).cwiseAbs().maxCoeff(), 0.0,
                 kFastestMode_1_s);
}

}  // namespace equipoise
