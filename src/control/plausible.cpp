#include "equipoise/control/plausible.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace equipoise {

Recoverable recoverable(const CMatrix& A, const CMatrix& b, Eigen::Index i) {
  // w' A = pole w': w'x is the amount of the unstable mode, which u can move by at most |w'b| / pole.
  const Eigen::ComplexEigenSolver<CMatrix> left(A.transpose());
  Eigen::Index mode = 0;
  left.eigenvalues().real().maxCoeff(&mode);
  const Eigen::VectorXcd w = left.eigenvectors().col(mode);
  const double pole = left.eigenvalues()(mode).real();
  return {pole, std::abs((w.transpose() * b)(0, 0)) / (pole * std::abs(w(i)))};
}

Margins state_feedback_margins(const SampledSystem& system, const CMatrix& K, double period_s) {
  const Eigen::Index n = system.A.rows();
  const std::vector<double> omega = frequency_grid(period_s, 120, 0.0);
  std::vector<Complex> L;
  L.reserve(omega.size());
  for (const double w : omega) {
    const Complex z = std::polar(1.0, w * period_s);
    const CMatrix x =
        (z * CMatrix::Identity(n, n) - system.A).partialPivLu().solve(system.B + system.B_late / z);
    L.push_back((K.leftCols(n) * x)(0, 0) / (1.0 + K(0, n) / z));
  }
  return margins(omega, L, 0.0);
}

std::optional<DesignProblem> outside(const std::string& parameter, const std::string& what, double value,
                                     double low, double high) {
  if (value >= low && value <= high) return std::nullopt;
  return DesignProblem{parameter, "implausible: " + what + " is " + std::to_string(value) +
                                      "; allowed: " + std::to_string(low) + " to " + std::to_string(high)};
}

}  // namespace equipoise
