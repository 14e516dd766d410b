// Numbers of several robots side by side in a vector register: +, -, *, /, what is used of <cmath>,
// comparisons that give masks, select(mask, a, b). What is written for a `Real` computes one robot with
// double and kLanes with Lanes, by the same operations in the same order. `Isa` is of the instruction set
// that a file is compiled for, LaneTypes<its width>: code of two of them must not be mixed up by the linker.
// Simulation only; no allocation.
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
  /// To the last digit or two up to 1e6 rad.
  friend Lanes sin(const Lanes& a) noexcept { return turned(a, 0); }
  friend Lanes cos(const Lanes& a) noexcept { return turned(a, 1); }
  /// Of what is not negative, to the last digit or two: with 1 + a = m 2^k and m about 1, log m = 2 atanh(s)
  /// by its series in s = (m - 1) / (m + 1), at most 0.172.
  friend Lanes log1p(const Lanes& a) noexcept {
    using Bits = typename Isa::Unsigned;
    constexpr unsigned long long kRootOfHalf = 0x3fe6a09e667f3bcd;  // m lies between it and twice it
    constexpr unsigned long long kTwoTo52 = 0x4330000000000000;  // an integer below its mantissa is added so
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

 private:
  /// sin(a + quarters pi/2): a = k pi/2 + r with |r| <= pi/4, sine or cosine of r by their series.
  static Lanes turned(const Lanes& a, unsigned long long quarters) noexcept {
    using Whole = typename Isa::Unsigned;
    constexpr double kTwoOverPi = 0.63661977236758134308;
    // pi/2 in three parts, the first two of 33 bits: times k below 2^20 they are exact.
    constexpr double kFirst = 1.57079632673412561417;
    constexpr double kSecond = 6.07710050630396597660e-11;
    constexpr double kThird = 2.02226624879595063154e-21;
    constexpr double kRounds = 6755399441055744.0;  // 1.5 2^52: what is added to it is an integer at its end
    const Vector shifted = a.v * kTwoOverPi + kRounds;
    const Vector k = shifted - kRounds;
    const Vector r = ((a.v - k * kFirst) - k * kSecond) - k * kThird;
    const Vector z = r * r;
    Vector sine = Vector{} + 1.0 / (16.0 * 17.0);
    Vector cosine = Vector{} + 1.0 / (17.0 * 18.0);
    for (int n = 14; n > 0; n -= 2) sine = (1.0 - z * sine) * (1.0 / (n * (n + 1.0)));
    for (int n = 15; n > 0; n -= 2) cosine = (1.0 - z * cosine) * (1.0 / (n * (n + 1.0)));
    sine = r - r * z * sine;
    cosine = 1.0 - z * cosine;
    const Whole quarter = reinterpret_cast<Whole>(shifted) + quarters;
    const Vector value = (quarter & 1) != 0 ? cosine : sine;
    return Lanes((quarter & 2) != 0 ? -value : value);
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
