#include "equipoise/control/riccati.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace equipoise {
namespace {

// One instantiation each: a product or a factorisation per expression type would compile for half a minute.
CMatrix product(const CMatrix& a, const CMatrix& b) { return a * b; }
CMatrix adjoint(const CMatrix& a) { return a.adjoint(); }
CMatrix solve(const CMatrix& a, const CMatrix& b) { return a.partialPivLu().solve(b); }

/// Scaling and squaring; the scaled norm is below 1/2, where 14 terms leave less than 1e-16.
CMatrix exponential(const CMatrix& M) {
  const double norm = M.cwiseAbs().rowwise().sum().maxCoeff();
  int squarings = 0;
  while (std::ldexp(norm, -squarings) > 0.5 && squarings < 64) ++squarings;
  const CMatrix scaled = M * std::ldexp(1.0, -squarings);
  CMatrix sum = CMatrix::Identity(M.rows(), M.cols());
  CMatrix term = sum;
  for (int k = 1; k <= 14; ++k) {
    term = product(term, scaled) / static_cast<double>(k);
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = product(sum, sum);
  return sum;
}

/// The input before as states of their own.
Hold with_input_before(const SampledSystem& s) {
  const Eigen::Index n = s.A.rows();
  const Eigen::Index m = s.B.cols();
  Hold whole{CMatrix::Zero(n + m, n + m), CMatrix::Zero(n + m, m)};
  whole.A.topLeftCorner(n, n) = s.A;
  whole.A.topRightCorner(n, m) = s.B_late;
  whole.B.topRows(n) = s.B;
  whole.B.bottomRows(m).setIdentity();
  return whole;
}

}  // namespace

Hold hold(const CMatrix& A, const CMatrix& B, double t) {
  const Eigen::Index n = A.rows();
  const Eigen::Index m = B.cols();
  CMatrix block = CMatrix::Zero(n + m, n + m);
  block.topLeftCorner(n, n) = A * t;
  block.topRightCorner(n, m) = B * t;
  const CMatrix e = exponential(block);
  return {e.topLeftCorner(n, n), e.topRightCorner(n, m)};
}

SampledSystem sampled(const CMatrix& A, const CMatrix& B, double period, double delay) {
  const Hold fresh = hold(A, B, period - delay);  // under the new input, at the end of the period
  const Hold late = hold(A, B, delay);            // under the old one, at its start
  return {product(fresh.A, late.A), fresh.B, product(fresh.A, late.B)};
}

CMatrix riccati(const CMatrix& A_in, const CMatrix& B, const CMatrix& Q, const CMatrix& R) {
  const Eigen::Index n = A_in.rows();
  CMatrix A = A_in;
  CMatrix G = product(B, solve(R, adjoint(B)));
  CMatrix H = Q;
  CMatrix right(n, 2 * n);
  constexpr int kMaxDoublings = 60;  // 2^60 ticks: a pole at 1 - 1e-16 has settled
  for (int k = 0; k < kMaxDoublings; ++k) {
    right.leftCols(n) = A;
    right.rightCols(n) = G;
    const CMatrix solved = solve(CMatrix::Identity(n, n) + product(G, H), right);
    const CMatrix WA = solved.leftCols(n);
    const CMatrix WG = solved.rightCols(n);
    const CMatrix A_adjoint = adjoint(A);
    const CMatrix change = product(product(A_adjoint, H), WA);
    G += product(product(A, WG), A_adjoint);
    H += change;
    A = product(A, WA);
    G = 0.5 * (G + adjoint(G));
    H = 0.5 * (H + adjoint(H));
    const double size = H.norm();
    if (!std::isfinite(size)) return CMatrix::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
    if (change.norm() <= 1e-16 * size) break;
  }
  return H;
}

CMatrix lqr(const SampledSystem& system, const Eigen::VectorXd& state_weights,
            const Eigen::VectorXd& input_weights) {
  const Eigen::Index n = system.A.rows();
  const Eigen::Index m = system.B.cols();
  const bool late = system.B_late.norm() > 0.0;
  const Hold plant = late ? with_input_before(system) : Hold{system.A, system.B};
  const CMatrix R = input_weights.cast<Complex>().asDiagonal();
  CMatrix Q = CMatrix::Zero(plant.A.rows(), plant.A.rows());
  Q.diagonal().head(n) = state_weights.cast<Complex>();
  const CMatrix X = riccati(plant.A, plant.B, Q, R);
  const CMatrix BX = product(adjoint(plant.B), X);
  CMatrix K = CMatrix::Zero(m, n + m);
  K.leftCols(plant.A.rows()) = solve(R + product(BX, plant.B), product(BX, plant.A));
  return K;
}

Eigen::VectorXcd eigenvalues(const CMatrix& A) {
  const CMatrix H = Eigen::HessenbergDecomposition<CMatrix>(A).matrixH();
  Eigen::ComplexSchur<CMatrix> schur(A.rows());
  return schur.computeFromHessenberg(H, H, false).matrixT().diagonal();
}

Eigen::VectorXcd closed_loop_poles(const SampledSystem& system, const CMatrix& K) {
  const Hold plant = with_input_before(system);
  return eigenvalues(plant.A - product(plant.B, K));
}

double largest_pole(const SampledSystem& system, const CMatrix& K) {
  if (!K.allFinite()) return std::numeric_limits<double>::infinity();
  return closed_loop_poles(system, K).cwiseAbs().maxCoeff();
}

}  // namespace equipoise
