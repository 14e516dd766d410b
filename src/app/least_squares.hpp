// Linear least squares with 95 % confidence intervals. In: regressors, observations -> out: estimates,
// half-widths, R^2. Residuals of filtered data are correlated: the widths are scaled by the residuals' own
// correlation. What no row tells apart has an infinite width. Not RT-safe.
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

namespace equipoise::app {

struct LeastSquares {
  Eigen::VectorXd x;
  Eigen::VectorXd half_width;  // 95 %
  double r_squared = 0.0;
};

inline constexpr double kRankTolerance = 1e-12;

inline LeastSquares least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  LeastSquares fit;
  // Columns scaled to unit length: parameters differ by decades.
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).transpose();
  const Eigen::MatrixXd S = A * scale.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd normal = S.transpose() * S;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum(normal);
  const Eigen::VectorXd& values = spectrum.eigenvalues();  // of columns of length one: at most their number
  const Eigen::VectorXd reciprocal =
      values.unaryExpr([](double v) { return v > kRankTolerance ? 1.0 / v : 0.0; });
  const Eigen::MatrixXd inverse =
      spectrum.eigenvectors() * reciprocal.asDiagonal() * spectrum.eigenvectors().transpose();
  const Eigen::VectorXd scaled = inverse * (S.transpose() * b);
  fit.x = scaled.cwiseQuotient(scale);
  const Eigen::VectorXd r = b - A * fit.x;
  const double n = static_cast<double>(A.rows());
  const double variance = r.squaredNorm() / std::max(1.0, n - static_cast<double>(A.cols()));
  double correlation = 1.0;
  for (Eigen::Index lag = 1; lag <= 50 && lag < r.size(); ++lag) {
    const double rho = r.head(r.size() - lag).dot(r.tail(r.size() - lag)) / std::max(r.squaredNorm(), 1e-300);
    if (rho < 0.05) break;
    correlation += 2.0 * rho;
  }
  fit.half_width =
      1.96 * (variance * correlation * inverse.diagonal()).cwiseMax(0.0).cwiseSqrt().cwiseQuotient(scale);
  fit.r_squared = 1.0 - r.squaredNorm() / std::max(1e-300, (b.array() - b.mean()).matrix().squaredNorm());
  const Eigen::MatrixXd resolution = inverse * normal;
  for (Eigen::Index i = 0; i < A.cols(); ++i) {
    if (resolution(i, i) < 1.0 - 1e-6) fit.half_width(i) = std::numeric_limits<double>::infinity();
  }
  return fit;
}

}  // namespace equipoise::app
