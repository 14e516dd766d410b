#include "app/identify/least_squares.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace equipoise::app {
namespace {

using Eigen::Index;

constexpr double kRankTolerance = 1e-12;  // of columns scaled to length one
constexpr double kTiny = 1e-300;

/// How many times fewer independent residuals there are than residuals.
double correlation(const Eigen::VectorXd& r) {
  constexpr Index kLags = 50;
  double sum = 1.0;
  for (Index lag = 1; lag <= kLags && lag < r.size(); ++lag) {
    double product = 0.0;
    for (Index i = lag; i < r.size(); ++i) product += r(i) * r(i - lag);
    const double rho = product / std::max(r.squaredNorm(), kTiny);
    if (rho < 0.05) break;
    sum += 2.0 * rho;
  }
  return sum;
}

}  // namespace

LeastSquares least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  const Index p = A.cols();
  // Parameters differ by decades.
  const Eigen::VectorXd scale = A.colwise().norm().unaryExpr([](double s) { return s > 0.0 ? s : 1.0; });
  const Eigen::MatrixXd scaled = A * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> normal(scaled.transpose() * scaled);
  const Eigen::VectorXd& lambda = normal.eigenvalues();
  const Eigen::MatrixXd& V = normal.eigenvectors();
  const Eigen::VectorXd inverse =
      lambda.unaryExpr([](double l) { return l < kRankTolerance ? 0.0 : 1.0 / l; });

  LeastSquares fit;
  fit.x = (V * inverse.asDiagonal() * V.transpose() * (scaled.transpose() * b)).cwiseQuotient(scale);
  const Eigen::VectorXd r = b - A * fit.x;
  const double variance = r.squaredNorm() / std::max(1.0, static_cast<double>(A.rows() - p)) * correlation(r);
  fit.half_width.resize(p);
  for (Index i = 0; i < p; ++i) {
    double width = 0.0;
    bool told_apart = true;  // no part of a combination that no row sees
    for (Index k = 0; k < p; ++k) {
      width += inverse(k) * V(i, k) * V(i, k);
      told_apart = told_apart && (inverse(k) > 0.0 || std::abs(V(i, k)) < 1e-6);
    }
    fit.half_width(i) =
        told_apart ? 1.96 * std::sqrt(variance * width) / scale(i) : std::numeric_limits<double>::infinity();
  }
  const double mean = b.mean();
  const double spread = (b.array() - mean).square().sum() + kTiny;
  fit.r_squared = 1.0 - r.squaredNorm() / spread;
  return fit;
}

}  // namespace equipoise::app
