// Numbers of several robots side by side in a vector register: +, -, *, /, what is used of <cmath>, comparisons
// that give masks, select(mask, a, b). What is written for a `Real` computes one robot with double and kLanes
// with Lanes, by the same operations in the same order. `Isa` is of the instruction set that a file is
// compiled for, LaneTypes<its width>: code of two of them must not be mixed up by the linker. Simulation
// only; no allocation.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "equipoise/real.hpp"

namespace equipoise {

template <class Isa>
struct LaneMask {
  using Bits = typename Isa::Bits;

  Bits bits;

  friend LaneMask operator&&(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits & b.bits}; }
  friend LaneMask operator||(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits | b.bits}; }
  friend bool all(const LaneMask& m) noexcept {
    long long whole = -1;
    for (int i = 0; i < Isa::kLanes; ++i) whole &= m.bits[i];
    return whole != 0;
  }
};

template <class Isa>
struct Lanes {
  using Vector = typename Isa::Vector;
  static constexpr int kLanes = Isa::kLanes;
  using Mask = LaneMask<Isa>;

  Vector v;

  Lanes() = default;
  Lanes(double same) noexcept {  // a number of all robots
    for (int i = 0; i < kLanes; ++i) v[i] = same;
  }
  explicit Lanes(const Vector& vector) noexcept : v(vector) {}

  double operator[](int lane) const noexcept { return v[lane]; }

  friend Lanes operator+(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v + b.v); }
  friend Lanes operator-(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v - b.v); }
  friend Lanes operator*(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v * b.v); }
  friend Lanes operator/(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v / b.v); }
  friend Lanes operator-(const Lanes& a) noexcept { return Lanes(-a.v); }
  Lanes& operator+=(const Lanes& b) noexcept { return *this = *this + b; }
  Lanes& operator-=(const Lanes& b) noexcept { return *this = *this - b; }
  Lanes& operator*=(const Lanes& b) noexcept { return *this = *this * b; }
  Lanes& operator/=(const Lanes& b) noexcept { return *this = *this / b; }

  friend Mask operator<(const Lanes& a, const Lanes& b) noexcept { return {a.v < b.v}; }
  friend Mask operator>(const Lanes& a, const Lanes& b) noexcept { return {a.v > b.v}; }
  friend Mask operator<=(const Lanes& a, const Lanes& b) noexcept { return {a.v <= b.v}; }
  friend Mask operator>=(const Lanes& a, const Lanes& b) noexcept { return {a.v >= b.v}; }
  friend Mask operator==(const Lanes& a, const Lanes& b) noexcept { return {a.v == b.v}; }
  friend Lanes select(const Mask& mask, const Lanes& a, const Lanes& b) noexcept {
    return Lanes(mask.bits ? a.v : b.v);
  }

  friend Lanes abs(const Lanes& a) noexcept { return select(a < Lanes(0.0), -a, a); }
  friend Lanes sin(const Lanes& a) noexcept {
    return each(a, [](double x) { return std::sin(x); });
  }
  /// Of what is not negative, to the last digit or two: with 1 + a = m 2^k and m about 1, log m = 2 atanh(s) by
  /// its series in s = (m - 1) / (m + 1), at most 0.172.
  friend Lanes log1p(const Lanes& a) noexcept {
    using Bits = typename Isa::Unsigned;
    constexpr unsigned long long kRootOfHalf = 0x3fe6a09e667f3bcd;  // m lies between it and twice it
    constexpr unsigned long long kTwoTo52 = 0x4330000000000000;     // an integer below its mantissa is added so
    constexpr double kLn2 = 0.69314718055994530942;
    const Vector u = 1.0 + a.v;
    const Vector lost = (a.v - (u - 1.0)) / u;  // of a, in rounding
    const Bits bits = reinterpret_cast<Bits>(u);
    const Bits k = (bits - kRootOfHalf) >> 52;
    const Vector f = reinterpret_cast<Vector>(bits - (k << 52)) - 1.0;
    const Vector exponent = reinterpret_cast<Vector>(k | kTwoTo52) - 4503599627370496.0;
    const Vector s = f / (2.0 + f);
    const Vector z = s * s;
    Vector series = Vector{} + 1.0 / 21.0;
    for (int n = 19; n > 0; n -= 2) series = series * z + 1.0 / n;
    return Lanes(exponent * kLn2 + (2.0 * s * series + lost));
  }
  friend Lanes cos(const Lanes& a) noexcept {
    return each(a, [](double x) { return std::cos(x); });
  }

 private:
  template <class Function>
  static Lanes each(const Lanes& a, Function&& function) noexcept {
    Lanes out;
    for (int i = 0; i < kLanes; ++i) out.v[i] = function(a.v[i]);
    return out;
  }
};

}  // namespace equipoise

namespace Eigen {

template <class Isa>
struct NumTraits<equipoise::Lanes<Isa>> : GenericNumTraits<equipoise::Lanes<Isa>> {
  using Real = equipoise::Lanes<Isa>;
  using NonInteger = Real;
  using Nested = Real;
  using Literal = double;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 0,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};
template <class Isa, class Operation>
struct ScalarBinaryOpTraits<double, equipoise::Lanes<Isa>, Operation> {
  using ReturnType = equipoise::Lanes<Isa>;
};
template <class Isa, class Operation>
struct ScalarBinaryOpTraits<equipoise::Lanes<Isa>, double, Operation> {
  using ReturnType = equipoise::Lanes<Isa>;
};

}  // namespace Eigen
