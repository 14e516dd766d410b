// Numbers of eight robots side by side, in one or more of the processor's vector registers: +, -, *, /, what
// <cmath> has of them, comparisons that give masks, select(mask, a, b). What is written for a `Real` computes
// one robot with double and eight with Lanes, by the same operations in the same order. `Isa` names the
// instruction set that a file is compiled for: code of two of them must not be mixed up by the linker.
// Simulation only; no allocation.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "equipoise/real.hpp"

namespace equipoise {

inline constexpr int kLanes = 8;

template <class Isa>
struct LaneMask {
  using Bits = long long __attribute__((vector_size(64)));

  Bits bits;

  friend LaneMask operator&&(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits & b.bits}; }
  friend LaneMask operator||(const LaneMask& a, const LaneMask& b) noexcept { return {a.bits | b.bits}; }
  friend bool all(const LaneMask& m) noexcept {
    long long whole = -1;
    for (int i = 0; i < kLanes; ++i) whole &= m.bits[i];
    return whole != 0;
  }
};

template <class Isa>
struct Lanes {
  using Vector = double __attribute__((vector_size(64)));
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
  friend Lanes log1p(const Lanes& a) noexcept {
    return each(a, [](double x) { return std::log1p(x); });
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
