// Linear least squares with 95 % confidence intervals. In: regressors, observations -> out: estimates,
// half-widths, R^2. Residuals of filtered data are correlated: the widths are scaled by the residuals' own
// correlation. What no row tells apart has an infinite width. Not RT-safe.
#pragma once

#include <Eigen/Core>

namespace equipoise::app {

struct LeastSquares {
  Eigen::VectorXd x;
  Eigen::VectorXd half_width;  // 95 %
  double r_squared = 0.0;
};

LeastSquares least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

}  // namespace equipoise::app
