#include "least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace equipoise::app {
namespace {

using Eigen::Index;

constexpr double kRankTolerance = 1e-12;  // of columns scaled to length one
constexpr double kTiny = 1e-300;

/// Gauss-Jordan in place on [N | c]: N becomes its inverse over the columns that could be swept, c the
/// solution.
std::vector<bool> sweep(Eigen::MatrixXd* M) {
  const Index p = M->rows();
  std::vector<bool> swept(static_cast<std::size_t>(p), false);
  for (Index k = 0; k < p; ++k) {
    const double pivot = (*M)(k, k);
    if (pivot < kRankTolerance) continue;
    swept[static_cast<std::size_t>(k)] = true;
    for (Index j = 0; j <= p; ++j) {
      if (j != k) (*M)(k, j) /= pivot;
    }
    for (Index i = 0; i < p; ++i) {
      if (i == k) continue;
      const double factor = (*M)(i, k);
      for (Index j = 0; j <= p; ++j) {
        if (j != k) (*M)(i, j) -= factor * (*M)(k, j);
      }
      (*M)(i, k) = -factor / pivot;
    }
    (*M)(k, k) = 1.0 / pivot;
  }
  return swept;
}

/// Neither left out, nor mixed with one that was.
bool resolved(const Eigen::MatrixXd& M, const std::vector<bool>& swept, Index i) {
  if (!swept[static_cast<std::size_t>(i)]) return false;
  for (Index j = 0; j < M.rows(); ++j) {
    if (!swept[static_cast<std::size_t>(j)] && std::abs(M(i, j)) > 1e-6) return false;
  }
  return true;
}

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
  const Index n = A.rows();
  const Index p = A.cols();
  Eigen::VectorXd scale(p);  // parameters differ by decades
  for (Index j = 0; j < p; ++j) scale(j) = A.col(j).norm() > 0.0 ? A.col(j).norm() : 1.0;
  Eigen::MatrixXd M(p, p + 1);
  for (Index i = 0; i < p; ++i) {
    for (Index j = 0; j < p; ++j) M(i, j) = A.col(i).dot(A.col(j)) / (scale(i) * scale(j));
    M(i, p) = A.col(i).dot(b) / scale(i);
  }
  const std::vector<bool> swept = sweep(&M);

  LeastSquares fit;
  fit.x.setZero(p);
  fit.half_width.setZero(p);
  Eigen::VectorXd r = b;
  for (Index i = 0; i < p; ++i) {
    if (swept[static_cast<std::size_t>(i)]) fit.x(i) = M(i, p) / scale(i);
    r -= fit.x(i) * A.col(i);
  }
  const double variance = r.squaredNorm() / std::max(1.0, static_cast<double>(n - p)) * correlation(r);
  for (Index i = 0; i < p; ++i) {
    fit.half_width(i) = resolved(M, swept, i) ? 1.96 * std::sqrt(variance * std::max(M(i, i), 0.0)) / scale(i)
                                              : std::numeric_limits<double>::infinity();
  }
  const double mean = b.mean();
  double spread = kTiny;
  for (Index i = 0; i < n; ++i) spread += (b(i) - mean) * (b(i) - mean);
  fit.r_squared = 1.0 - r.squaredNorm() / spread;
  return fit;
}

}  // namespace equipoise::app
