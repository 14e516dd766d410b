// Sampled linear-quadratic design, real or complex: zero-order hold with a late input, and the discrete
// Riccati equation by structure-preserving doubling (Chu, Fan, Lin, Wang 2004: "A structure-preserving
// doubling algorithm for periodic discrete-time algebraic Riccati equations").
// In: continuous A, B, weights -> out: sampled system, gain. Start-up only: allocates.
#pragma once

#include <Eigen/Core>
#include <complex>

namespace equipoise {

using Complex = std::complex<double>;
using CMatrix = Eigen::MatrixXcd;

/// x(k+1) = A x(k) + B u(k) + B_late u(k-1).
struct SampledSystem {
  CMatrix A;
  CMatrix B;
  CMatrix B_late;  // zero without a delay
};

/// exp(A t) and its integral times B: what a held input does in `t`.
struct Hold {
  CMatrix A;
  CMatrix B;
};
Hold hold(const CMatrix& A, const CMatrix& B, double t);

/// The input takes effect `delay` after its tick, 0 <= delay <= period.
SampledSystem sampled(const CMatrix& A, const CMatrix& B, double period, double delay);

/// X = A' X A - A' X B (R + B' X B)^-1 B' X A + Q, ' conjugate transposed; the stabilising solution. Not
/// finite when there is none.
CMatrix riccati(const CMatrix& A, const CMatrix& B, const CMatrix& Q, const CMatrix& R);

/// K of u = -K (x, u before) that minimises sum x' Q x + u' R u; weights are diagonals. One column per state
/// and one per input for the input before, which is zero without a delay.
CMatrix lqr(const SampledSystem& system, const Eigen::VectorXd& state_weights,
            const Eigen::VectorXd& input_weights);

/// Of a square matrix. (Eigen's solvers of its own would also compile what eigenvectors need, in every file.)
Eigen::VectorXcd eigenvalues(const CMatrix& A);

/// Largest closed-loop magnitude under u = -K (x, u before).
double largest_pole(const SampledSystem& system, const CMatrix& K);
/// Closed-loop poles of the same.
Eigen::VectorXcd closed_loop_poles(const SampledSystem& system, const CMatrix& K);

}  // namespace equipoise
