// KalmanFilter<MbbrEkfModel>, as generated straight-line code on the packed triangle of P: the same numbers
// up to rounding for a fraction of the instructions. In: input, measurements with a mask of those to use ->
// state, variances, normalised innovation. Source: tools/derive/mbbr_filter.py, docs/derivation.md. RT-safe.
#pragma once

#include <array>

#include "equipoise/types.hpp"
#include "generated/mbbr_filter.hpp"

namespace equipoise {

class MbbrPackedFilter {
 public:
  static constexpr int n = generated::mbbr_filter::kStates;
  static constexpr int m = 8;

  /// `constants`: with the noises in it; `initial_variance`: diagonal of P.
  MbbrPackedFilter(const generated::mbbr_filter::Constants& constants,
                   const Vec<n>& initial_variance) noexcept;

  void reset(const Vec<n>& x) noexcept;
  void predict(const Vec3& u) noexcept;
  void update(const Vec3& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept;
  /// Adds to the variances of `count` states from `first` on.
  void widen(int first, int count, double variance) noexcept;

  const Vec<n>& x() const noexcept { return x_; }
  Mat<n, n> P() const noexcept;
  double variance(int state) const noexcept;
  /// Mean of those rows that were used.
  double normalized_innovation() const noexcept { return normalized_innovation_; }
  /// Squared innovation over its variance, of each row; 0 where it was not used.
  const std::array<double, m>& row_nis() const noexcept { return row_nis_; }

 private:
  generated::mbbr_filter::Constants constants_;
  Vec<n> initial_variance_;
  Vec<n> x_;
  std::array<double, generated::mbbr_filter::kTriangle> P_{};
  double normalized_innovation_ = 0.0;
  std::array<double, m> row_nis_{};
};

}  // namespace equipoise
