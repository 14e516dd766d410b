// KalmanFilter of a model whose step is generated as straight-line code: the same numbers up to rounding, for
// a fraction of the instructions, in single or double precision. P is an upper triangle packed by rows, so
// that it is symmetric by form; its rows start at even columns, so that pairs are aligned. Angles that grow
// are kept within a radian, so that single precision resolves them; what is whole in them stands beside.
// An angle that no sample shows is forgotten before its variance takes the digits of the others'. Filters
// that are copies share their constants; one can adopt the state of another for the price of a copy.
// In: input, measurements with a mask of those to use -> state, variances, innovations and their variances.
// Source: tools/derive/packed.py; docs/filter.md. RT-safe: fixed size, bounded.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <memory>
#include <type_traits>
#include <utility>
#include <variant>

#include "equipoise/estimate/downdate.hpp"
#include "equipoise/estimate/kalman.hpp"
#include "equipoise/types.hpp"

namespace equipoise {

/// Steps: generated, with Constants, prepare(), predict(), innovate(). A Model supplies, beside what
/// KalmanFilter asks for, `Steps::Constants<double> constants()` without the noises, `kTurning`, the first of
/// `kTurnings` angles that its motion does not depend on, and `turning_rows()`, how the samples do: those of
/// the wheels, as many from `kWheel` on.
template <class Model, class Steps>
class PackedFilter {
 public:
  static constexpr int n = Model::kStates;
  static constexpr int m = Model::kOutputs;
  static constexpr int p = Model::kInputs;
  static constexpr int kMotion = Steps::kMotion;  // states that move, the first
  static_assert(Steps::kStates == n && Steps::kOutputs == m && Steps::kInputs == p && n % 2 == 0);
  static_assert(Steps::kTickS == kTickS);
  static constexpr int kPrecise = static_cast<int>(std::size(Steps::kPrecise));
  using Params = typename KalmanFilter<Model>::Params;

  PackedFilter(const Model& model, const Params& params, Precision precision = Precision::kDouble)
      : initial_variance_(params.initial_variance),
        turning_rows_(model.turning_rows()),
        of_wheel_(turning_rows_.template middleRows<Model::kTurnings>(Model::kWheel).inverse()) {
    Constants<double> k = model.constants();
    const Mat<n, p> B = model.input_matrix();
    Mat<n, n> Q = B * params.input_variance.asDiagonal() * B.transpose();
    Q.diagonal() += params.Q;
    int place = 0;
    for (const auto& [state, input] : Steps::kB) k.B[place++] = B(state, input);
    place = 0;
    for (const auto& [row, column] : Steps::kQ) k.Q[place++] = Q(row, column);
    Steps::prepare(k);
    if (precision == Precision::kSingle) {
      core_ = Core<float>{std::make_shared<const Constants<float>>(rounded(k))};
    } else {
      core_ = Core<double>{std::make_shared<const Constants<double>>(k)};
    }
    for (int i = 0; i < m; ++i) set_row_noise(static_cast<std::size_t>(i), params.R(i));
    reset(Vec<n>::Zero());
  }

  void reset(const Vec<n>& x) noexcept {
    whole_.setZero();
    expected_whole_.setZero();
    on_core(core_, [&](auto& core) {
      core.P.fill(0);
      for (int i = 0; i < n; ++i)
        core.P[place(i, i)] = static_cast<RealOf<decltype(core)>>(initial_variance_(i));
      take(x, core);
    });
    normalized_innovation_ = 0.0;
    row_nis_.fill(0.0);
    row_innovation_.fill(0.0);
    row_variance_.fill(0.0);
  }

  /// State, variances and innovations of `other`, in whichever precision; constants and noise stay this
  /// one's.
  void adopt(const PackedFilter& other) noexcept {
    on_core(core_, [&](auto& core) {
      on_core(other.core_, [&](const auto& from) {
        using Real = RealOf<decltype(core)>;
        if constexpr (std::is_same_v<Real, RealOf<decltype(from)>>) {  // as bytes, not through VFP
          core.x = from.x;
          core.P = from.P;
        } else {
          const auto to_real = [](auto v) { return static_cast<Real>(v); };
          std::transform(from.x.begin(), from.x.end(), core.x.begin(), to_real);
          std::transform(from.P.begin(), from.P.end(), core.P.begin(), to_real);
        }
      });
    });
    x_ = other.x_;
    whole_ = other.whole_;
    expected_whole_ = other.expected_whole_;
    normalized_innovation_ = other.normalized_innovation_;
    row_nis_ = other.row_nis_;
    row_innovation_ = other.row_innovation_;
    row_variance_ = other.row_variance_;
  }

  /// The motion's states `x` after dt, with what acts, input and disturbance.
  void ahead(const Vec<p>& u, double dt, Vec<kMotion>& x) const noexcept {
    const Turnings from = x.template segment<Model::kTurnings>(Model::kTurning);
    x.template segment<Model::kTurnings>(Model::kTurning).setZero();
    on_core(core_, [&](const auto& core) {
      using Real = RealOf<decltype(core)>;
      const Vector<Real, p> acts(u);
      Vector<Real, kMotion> moved(x);
      Steps::ahead(*core.k, acts.data(), static_cast<Real>(dt), moved.data());
      moved.copy_to(x);
    });
    x.template segment<Model::kTurnings>(Model::kTurning) += from;
  }

  void predict(const Vec<p>& u) noexcept {
    on_core(core_, [&](auto& core) {
      const Vector<RealOf<decltype(core)>, p> acts(u);
      Steps::predict(*core.k, acts.data(), core.x.data(), core.P.data() + Steps::kMiddleP);
      show(core);
    });
  }

  void update(const Vec<p>& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
    innovate(u, y, use);
    correct();
  }

  /// Innovations of the samples and their variances; the state stays as predicted.
  void innovate(const Vec<p>& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
    on_core(core_, [&](auto& core) { innovate(core, u, y, use); });
    double nis = 0.0;
    int used = 0;
    for (std::size_t i = 0; i < m; ++i) {
      nis += row_nis_[i];
      used += use[i] ? 1 : 0;
    }
    normalized_innovation_ = used > 0 ? nis / used : 0.0;
  }

  /// The same of a P that was widened since: the correction changes, the rows' innovations stay as told.
  void weigh_again(const Vec<p>& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
    const std::array<double, m> nis = row_nis_;
    const std::array<double, m> innovation = row_innovation_;
    const std::array<double, m> variance = row_variance_;
    innovate(u, y, use);
    row_nis_ = nis;
    row_innovation_ = innovation;
    row_variance_ = variance;
  }

  /// Of a tick without samples there is nothing to correct.
  void miss() noexcept {
    row_nis_.fill(0.0);
    row_innovation_.fill(0.0);
    normalized_innovation_ = 0.0;
  }

  /// By the samples that innovate() was given last, nothing having happened since.
  void correct() noexcept {
    on_core(core_, [&](auto& core) {
      if constexpr (std::is_same_v<RealOf<decltype(core)>, float>) {
        correct(core, std::make_index_sequence<kPrecise>());
      } else {  // keeps the digits
        equipoise::correct<n, m>(core.step, core.Ph, core.x.data());
        downdate<n, m>(core.weight, core.Ph, core.P.data());
      }
      forget_unseen(core);
      keep_small(core);
      show(core);
    });
  }

  /// Adds to the variances of `count` states from `first` on.
  void widen(int first, int count, double variance) noexcept {
    on_core(core_, [&](auto& core) {
      for (int i = first; i < first + count; ++i)
        core.P[place(i, i)] += static_cast<RealOf<decltype(core)>>(variance);
    });
  }

  /// Adds the covariance `variance` d d' of the states from `first` on.
  template <int count>
  void widen(int first, const Vec<count>& d, double variance) noexcept {
    on_core(core_, [&](auto& core) {
      for (int i = 0; i < count; ++i) {
        for (int j = i; j < count; ++j)
          core.P[place(first + i, first + j)] += static_cast<RealOf<decltype(core)>>(variance * d(i) * d(j));
      }
    });
  }

  /// The same of the covariance of two states.
  void correlate(int one, int other, double covariance) noexcept {
    on_core(core_, [&](auto& core) {
      core.P[place(one, other)] += static_cast<RealOf<decltype(core)>>(covariance);
    });
  }

  /// Keeps a state's estimate, no angle, within +-`most` (projection: Simon 2006, 7.5).
  void limit(int state, double most) noexcept {
    on_core(core_, [&](auto& core) {
      auto& x = core.x[static_cast<std::size_t>(state)];
      const auto limit = static_cast<RealOf<decltype(core)>>(most);
      x = std::clamp(x, -limit, limit);
      x_(state) = static_cast<double>(x);
    });
  }

  const Vec<n>& x() const noexcept { return x_; }
  double variance(int state) const noexcept { return P_at(state, state); }
  Mat<n, n> P() const noexcept {
    return Mat<n, n>::NullaryExpr(
        [this](Eigen::Index i, Eigen::Index j) { return P_at(static_cast<int>(i), static_cast<int>(j)); });
  }
  double normalized_innovation() const noexcept { return normalized_innovation_; }
  /// Squared innovation over its variance, of each row; 0 where it was not used.
  const std::array<double, m>& row_nis() const noexcept { return row_nis_; }
  /// Of each row, used or not, given the rows before it that were used; in the rows' units.
  const std::array<double, m>& row_innovation() const noexcept { return row_innovation_; }
  const std::array<double, m>& row_variance() const noexcept { return row_variance_; }
  /// Variance of a row's sensor.
  double row_noise(std::size_t row) const noexcept {
    return on_core(core_, [&](const auto& core) { return static_cast<double>(core.R[row]); });
  }
  void set_row_noise(std::size_t row, double variance) noexcept {
    on_core(core_, [&](auto& core) { core.R[row] = static_cast<RealOf<decltype(core)>>(variance); });
  }

 private:
  template <class Real>
  using Constants = typename Steps::template Constants<Real>;
  using Turnings = Vec<Model::kTurnings>;

  template <class Real>
  struct Core {
    using Number = Real;
    std::shared_ptr<const Constants<Real>> k;
    alignas(16) std::array<Real, n> x{};
    alignas(16) std::array<Real, static_cast<std::size_t>(Steps::kTriangle)> P{};
    std::array<Real, m> R{};
    // Of innovate(), for correct():
    alignas(16) Real Ph[n * m]{};
    Real weight[m]{};
    Real step[1 + kPrecise][m]{};  // the innovations' and, for restore(), columns of the gain
    Real h[Steps::kEntries]{};
  };
  template <class C>
  using RealOf = typename std::decay_t<C>::Number;

  /// A vector of the core's numbers.
  template <class Real, int size>
  struct Vector {
    std::array<Real, size> v;
    explicit Vector(const Vec<size>& from) noexcept {
      for (int i = 0; i < size; ++i) v[static_cast<std::size_t>(i)] = static_cast<Real>(from(i));
    }
    const Real* data() const noexcept { return v.data(); }
    Real* data() noexcept { return v.data(); }
    void copy_to(Vec<size>& to) const noexcept {
      for (int i = 0; i < size; ++i) to(i) = static_cast<double>(v[static_cast<std::size_t>(i)]);
    }
  };

  static Constants<float> rounded(const Constants<double>& k) noexcept {
    constexpr std::size_t kNumbers = sizeof k / sizeof(double);
    static_assert(sizeof(Constants<float>) == kNumbers * sizeof(float));
    std::array<double, kNumbers> from;
    std::array<float, kNumbers> to;
    std::memcpy(from.data(), &k, sizeof k);
    std::transform(from.begin(), from.end(), to.begin(), [](double v) { return static_cast<float>(v); });
    Constants<float> result;
    std::memcpy(&result, to.data(), sizeof result);
    return result;
  }

  /// f(core) in its precision. std::visit might throw, as far as the compiler knows.
  template <class Either, class F>
  static auto on_core(Either& either, F&& f) noexcept {
    auto* const in_double = std::get_if<Core<double>>(&either);
    return in_double != nullptr ? f(*in_double) : f(*std::get_if<Core<float>>(&either));
  }

  static constexpr std::size_t place(int row, int column) noexcept {
    const int i = row < column ? row : column;
    const int j = row < column ? column : row;
    return static_cast<std::size_t>(i * n - 2 * (i / 2) * ((i - 1) / 2) + j - i / 2 * 2);
  }
  double P_at(int row, int column) const noexcept {
    return on_core(core_, [&](const auto& core) { return static_cast<double>(core.P[place(row, column)]); });
  }

  template <class Real>
  void innovate(Core<Real>& core, const Vec<p>& u, const Vec<m>& y, const std::array<bool, m>& use) noexcept {
    Real innovation[m];
    Real variance[m];
    Real nis[m];
    const Vector<Real, p> acts(u);
    const Vector<Real, m> seen(y - expected_whole_);
    Steps::innovate(*core.k, acts.data(), seen.data(), use.data(), core.R.data(), core.x.data(),
                    core.P.data() + Steps::kMiddleP, core.Ph + Steps::kMiddlePh, core.weight, core.step[0],
                    innovation, variance, nis, core.h, core.step[1]);
    for (std::size_t i = 0; i < m; ++i) {
      row_innovation_[i] = static_cast<double>(innovation[i]);
      row_variance_[i] = static_cast<double>(variance[i]);
      row_nis_[i] = static_cast<double>(nis[i]);
    }
  }

  template <std::size_t... i>
  static void correct(Core<float>& core, std::index_sequence<i...> /*precise*/) noexcept {
    alignas(16) float exact[kPrecise * n];
    bool use[kPrecise];
    for (int k = 0; k < kPrecise; ++k) use[k] = core.weight[Steps::kPrecise[k][0]] != 0.0F;
    equipoise::correct<n, m>(core.step, core.Ph, core.x.data(), std::array{(exact + i * n)...});
    downdate<n, m>(core.weight, core.Ph, core.P.data());
    Steps::restore(use, core.h, exact, core.P.data() + Steps::kMiddleP);
  }

  template <class Real>
  void take(const Vec<n>& x, Core<Real>& core) noexcept {
    Vec<n> rest = x;
    for (int i = 0; i < Model::kTurnings; ++i) {
      whole_(i) = std::trunc(x(Model::kTurning + i));
      rest(Model::kTurning + i) -= whole_(i);
    }
    expected_whole_ = turning_rows_ * whole_;
    const Vector<Real, n> numbers(rest);
    core.x = numbers.v;
    show(core);
  }

  /// The angles as wheel i would see them alone, w' e, stand in no other sample: once nobody knows them to a
  /// radian, they start anew, apart from all else, P <- (I - d w') P (I - d w')' + V d d' with w' d = 1. The
  /// rest is as it was.
  template <class Real>
  void forget_unseen(Core<Real>& core) noexcept {
    constexpr int kAngles = Model::kTurnings;
    for (int i = 0; i < kAngles; ++i) {
      const auto row = static_cast<std::size_t>(Model::kWheel) + static_cast<std::size_t>(i);
      if (core.weight[row] != Real{0} || !(row_variance_[row] > 1.0)) continue;
      Vec<n> w = Vec<n>::Zero(), d = Vec<n>::Zero();
      w.template segment<kAngles>(Model::kTurning) = turning_rows_.row(Model::kWheel + i);
      d.template segment<kAngles>(Model::kTurning) = of_wheel_.col(i);
      const Vec<n> Pw = P() * w;
      const double anew = w.dot(Pw) + initial_variance_(Model::kTurning) * w.squaredNorm();
      for (int j = 0; j < n; ++j) {
        for (int k = j; k < n; ++k) {
          if (d(j) != 0.0 || d(k) != 0.0)
            core.P[place(j, k)] -= static_cast<Real>(d(j) * Pw(k) + Pw(j) * d(k) - d(j) * d(k) * anew);
        }
      }
    }
  }

  /// Whole radians leave the angles; exact in either precision. What is left rounds by 6e-8 rad at most.
  template <class Real>
  void keep_small(Core<Real>& core) noexcept {
    bool moved = false;
    for (int i = 0; i < Model::kTurnings; ++i) {
      Real& angle = core.x[static_cast<std::size_t>(Model::kTurning) + static_cast<std::size_t>(i)];
      if (!(std::abs(angle) > Real{1}) || !(std::abs(angle) < Real{1e9})) continue;
      const auto whole = static_cast<std::int32_t>(angle);
      angle -= static_cast<Real>(whole);
      whole_(i) += whole;
      moved = true;
    }
    if (moved) expected_whole_ = turning_rows_ * whole_;
  }

  template <class Real>
  void show(const Core<Real>& core) noexcept {
    for (int i = 0; i < n; ++i) x_(i) = static_cast<double>(core.x[static_cast<std::size_t>(i)]);
    x_.template segment<Model::kTurnings>(Model::kTurning) += whole_;
  }

  std::variant<Core<double>, Core<float>> core_;
  Vec<n> initial_variance_;
  Vec<n> x_;
  Mat<m, Model::kTurnings> turning_rows_;
  Mat<Model::kTurnings, Model::kTurnings> of_wheel_;  // the angles that one wheel sees and the others do not
  Turnings whole_;                                    // what x has beside the core's
  Vec<m> expected_whole_;                             // of the samples
  double normalized_innovation_ = 0.0;
  std::array<double, m> row_nis_{};
  std::array<double, m> row_innovation_{};
  std::array<double, m> row_variance_{};
};

}  // namespace equipoise
