#include "robots/mbbr/packed_filter.hpp"

#include <algorithm>

#include "generated/mbbr_filter_steps.hpp"

namespace equipoise {

namespace packed = generated::mbbr_filter;

static_assert(packed::kTickS == kTickS);

namespace {

/// Where the triangle holds P(i, j), states in the model's order.
struct Places {
  std::array<std::array<std::size_t, packed::kStates>, packed::kStates> at{};

  constexpr Places() {
    std::size_t place = 0;
    for (int i = 0; i < packed::kStates; ++i) {
      for (int j = i; j < packed::kStates; ++j) {
        const auto row = static_cast<std::size_t>(packed::kOrder[i]);
        const auto column = static_cast<std::size_t>(packed::kOrder[j]);
        at[row][column] = at[column][row] = place++;
      }
    }
  }
  constexpr std::size_t operator()(int i, int j) const {
    return at[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
};

constexpr Places kPlace;

}  // namespace

MbbrPackedFilter::MbbrPackedFilter(const packed::Constants& constants,
                                   const Vec<n>& initial_variance) noexcept
    : constants_(constants), initial_variance_(initial_variance) {
  reset(Vec<n>::Zero());
}

void MbbrPackedFilter::reset(const Vec<n>& x) noexcept {
  x_ = x;
  P_.fill(0.0);
  for (int i = 0; i < n; ++i) P_[kPlace(i, i)] = initial_variance_(i);
  normalized_innovation_ = 0.0;
  row_nis_.fill(0.0);
}

void MbbrPackedFilter::predict(const Vec3& u) noexcept {
  packed::predict(constants_, u.data(), x_.data(), P_.data());
}

void MbbrPackedFilter::update(const Vec3& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
  packed::update(constants_, u.data(), y.data(), use.data(), x_.data(), P_.data(), row_nis_.data());
  double nis = 0.0;
  for (const double row : row_nis_) nis += row;
  const auto used = std::count(use.begin(), use.end(), true);
  normalized_innovation_ = used > 0 ? nis / static_cast<double>(used) : 0.0;
}

void MbbrPackedFilter::widen(int first, int count, double variance) noexcept {
  for (int i = first; i < first + count; ++i) P_[kPlace(i, i)] += variance;
}

double MbbrPackedFilter::variance(int state) const noexcept { return P_[kPlace(state, state)]; }

Mat<MbbrPackedFilter::n, MbbrPackedFilter::n> MbbrPackedFilter::P() const noexcept {
  Mat<n, n> P;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) P(i, j) = P_[kPlace(i, j)];
  }
  return P;
}

}  // namespace equipoise
