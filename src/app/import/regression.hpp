// Least squares of one signal on one or two others, with standard errors for samples that are not
// independent. In: samples -> out: coefficients. Source: ordinary least squares; degrees of freedom by
// bandwidth, two a second and Hz. Not RT-safe.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <vector>

namespace equipoise::app {

struct Coefficient {
  double value = 0.0;
  double sigma = 0.0;
  /// It differs from zero by three sigma.
  bool known() const { return std::abs(value) > 3.0 * sigma; }
};

/// y = sum c_i x_i. `independent`: how many of the samples are.
inline std::vector<Coefficient> regression(const std::vector<std::vector<double>>& x,
                                           const std::vector<double>& y, double independent) {
  const auto n = static_cast<Eigen::Index>(y.size());
  const auto m = static_cast<Eigen::Index>(x.size());
  Eigen::MatrixXd X(n, m);
  for (Eigen::Index i = 0; i < m; ++i)
    X.col(i) = Eigen::Map<const Eigen::VectorXd>(x[static_cast<std::size_t>(i)].data(), n);
  const Eigen::Map<const Eigen::VectorXd> Y(y.data(), n);
  const Eigen::MatrixXd N = X.transpose() * X;
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(N);
  std::vector<Coefficient> out(x.size());
  if (!lu.isInvertible()) {
    for (Coefficient& c : out) c.sigma = INFINITY;
    return out;
  }
  const Eigen::MatrixXd inverse = lu.inverse();
  const Eigen::VectorXd c = inverse * (X.transpose() * Y);
  const double freedom = std::max(independent - static_cast<double>(m), 1.0);
  const double variance = (Y - X * c).squaredNorm() / freedom;
  for (Eigen::Index i = 0; i < m; ++i)
    out[static_cast<std::size_t>(i)] = {c(i), std::sqrt(variance * inverse(i, i))};
  return out;
}

}  // namespace equipoise::app
