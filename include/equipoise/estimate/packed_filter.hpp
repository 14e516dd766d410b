// KalmanFilter of a model whose step is generated as straight-line code: the same numbers up to rounding, for
// a fraction of the instructions. P is an upper triangle packed by rows, so that it is symmetric by form; its
// rows start at even columns, so that pairs are aligned.
// In: input, measurements with a mask of those to use -> state, variances, normalised innovation.
// Source: tools/derive/packed.py; docs/filter.md. RT-safe: fixed size, bounded.
#pragma once

#include <array>

#include "equipoise/estimate/downdate.hpp"
#include "equipoise/estimate/kalman.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

/// Steps: generated, with Constants, prepare(), predict(), correct(). A Model supplies, beside what
/// KalmanFilter asks for, `Steps::Constants constants()` without the noises.
template <class Model, class Steps>
class PackedFilter {
 public:
  static constexpr int n = Model::kStates;
  static constexpr int m = Model::kOutputs;
  static constexpr int p = Model::kInputs;
  static constexpr int kMotion = Steps::kMotion;  // states that move, the first
  static_assert(Steps::kStates == n && Steps::kOutputs == m && Steps::kInputs == p && n % 2 == 0);
  static_assert(Steps::kTickS == kTickS);
  using Params = typename KalmanFilter<Model>::Params;

  PackedFilter(const Model& model, const Params& params)
      : constants_(model.constants()), initial_variance_(params.initial_variance) {
    const Mat<n, p> B = model.input_matrix();
    Mat<n, n> Q = B * params.input_variance.asDiagonal() * B.transpose();
    Q.diagonal() += params.Q;
    int place = 0;
    for (const auto& [state, input] : Steps::kB) constants_.B[place++] = B(state, input);
    place = 0;
    for (const auto& [row, column] : Steps::kQ) constants_.Q[place++] = Q(row, column);
    Eigen::Map<Vec<m>>(constants_.R) = params.R;
    Steps::prepare(constants_);
    reset(Vec<n>::Zero());
  }

  void reset(const Vec<n>& x) noexcept {
    x_ = x;
    P_.fill(0.0);
    for (int i = 0; i < n; ++i) P_[place(i, i)] = initial_variance_(i);
    normalized_innovation_ = 0.0;
    row_nis_.fill(0.0);
    row_innovation_.fill(0.0);
  }

  /// The motion's states `x` after dt, with what acts, input and disturbance.
  void ahead(const Vec<p>& u, double dt, Vec<kMotion>& x) const noexcept {
    Steps::ahead(constants_, u.data(), dt, x.data());
  }

  void predict(const Vec<p>& u) noexcept {
    Steps::predict(constants_, u.data(), x_.data(), P_.data() + Steps::kMiddleP);
  }

  void update(const Vec<p>& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
    alignas(16) double Ph[n * m];
    double weight[m];
    Steps::correct(constants_, u.data(), y.data(), use.data(), x_.data(), P_.data() + Steps::kMiddleP,
                   Ph + Steps::kMiddlePh, weight, row_innovation_.data(), row_nis_.data());
    downdate<n, m>(weight, Ph, P_.data());
    double nis = 0.0;
    int used = 0;
    for (std::size_t i = 0; i < m; ++i) {
      nis += row_nis_[i];
      used += use[i] ? 1 : 0;
    }
    normalized_innovation_ = used > 0 ? nis / used : 0.0;
  }

  /// Adds to the variances of `count` states from `first` on.
  void widen(int first, int count, double variance) noexcept {
    for (int i = first; i < first + count; ++i) P_[place(i, i)] += variance;
  }

  const Vec<n>& x() const noexcept { return x_; }
  double variance(int state) const noexcept { return P_[place(state, state)]; }
  Mat<n, n> P() const noexcept {
    Mat<n, n> P;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) P(i, j) = P_[place(i, j)];
    }
    return P;
  }
  double normalized_innovation() const noexcept { return normalized_innovation_; }
  /// Squared innovation over its variance, of each row; 0 where it was not used.
  const std::array<double, m>& row_nis() const noexcept { return row_nis_; }
  /// In the rows' units.
  const std::array<double, m>& row_innovation() const noexcept { return row_innovation_; }

 private:
  static constexpr std::size_t place(int row, int column) noexcept {
    const int i = row < column ? row : column;
    const int j = row < column ? column : row;
    return static_cast<std::size_t>(i * n - 2 * (i / 2) * ((i - 1) / 2) + j - i / 2 * 2);
  }

  typename Steps::Constants constants_;
  Vec<n> initial_variance_;
  alignas(16) Vec<n> x_;
  alignas(16) std::array<double, static_cast<std::size_t>(Steps::kTriangle)> P_{};
  double normalized_innovation_ = 0.0;
  std::array<double, m> row_nis_{};
  std::array<double, m> row_innovation_{};
};

}  // namespace equipoise
