// Seeded noise, one independent stream per effect, so that switching one effect leaves the others' draws
// alone. Same seed, same numbers on one machine. Simulation only.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

#include "equipoise/types.hpp"

namespace equipoise {

/// Standard normal numbers by Marsaglia's polar method, drawn from the engine in blocks: those of libstdc++'s
/// std::normal_distribution to the bit, in six tenths of its time.
class StandardNormal {
 public:
  double operator()(std::mt19937_64& engine) {
    if (next_ == kBlock) draw(engine);
    return block_[next_++];
  }

 private:
  /// 0 <= u < 1.
  static double canonical(std::mt19937_64& engine) {
    const std::uint64_t word = engine();
    // In halves: a whole word is converted in one of two ways, which the processor cannot predict.
    const double high = static_cast<double>(static_cast<std::uint32_t>(word >> 32));
    const double low = static_cast<double>(static_cast<std::uint32_t>(word));
    const double u = (high * 0x1p32 + low) * 0x1p-64;
    return u < 1.0 ? u : 1.0 - 0x1p-53;
  }

  void draw(std::mt19937_64& engine) {
    std::array<double, kBlock / 2> r2{};
    for (std::size_t k = 0; k < r2.size();) {  // without a branch: a pair that is refused is overwritten
      const double x = 2.0 * canonical(engine) - 1.0;
      const double y = 2.0 * canonical(engine) - 1.0;
      r2[k] = x * x + y * y;
      block_[2 * k] = y;
      block_[2 * k + 1] = x;
      k += r2[k] <= 1.0 && r2[k] != 0.0 ? 1 : 0;
    }
    for (std::size_t k = 0; k < r2.size(); ++k) {
      const double scale = std::sqrt(-2.0 * std::log(r2[k]) / r2[k]);
      block_[2 * k] *= scale;
      block_[2 * k + 1] *= scale;
    }
    next_ = 0;
  }

  static constexpr std::size_t kBlock = 64;
  std::array<double, kBlock> block_{};
  std::size_t next_ = kBlock;
};

/// Streams of random numbers; the numbers are part of what a seed means.
enum NoiseEffect : std::uint64_t {
  kStartNoise = 1,
  kProcessNoise,
  kGyroNoise,
  kAccelNoise,
  kEncoderNoise,
  kAttitudeNoise,
  kVibration,
  kLoop
};

/// The mixing of splitmix64: neighbouring numbers give unrelated ones.
inline std::uint64_t mixed(std::uint64_t z) noexcept {
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}
/// In [0, 1), always the same for the same place.
inline double hashed_unit(std::uint64_t seed, std::int64_t a, std::int64_t b) noexcept {
  constexpr std::uint64_t kStep = 0x9E3779B97F4A7C15ULL;
  const std::uint64_t first = mixed(seed * kStep + static_cast<std::uint64_t>(a));
  return static_cast<double>(mixed(first * kStep + static_cast<std::uint64_t>(b)) >> 11) * 0x1p-53;
}

class NoiseStream {
 public:
  NoiseStream(std::uint64_t seed, std::uint64_t effect)
      : engine_(mixed(seed * 0x9E3779B97F4A7C15ULL + effect)) {}

  double gaussian(double sigma) { return sigma * normal_(engine_); }
  /// A stream that gives both kinds does not draw them in the order of the calls.
  double uniform(double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>(0.0, 1.0)(engine_);
  }
  /// Whether an event of that share of the calls happens at this one. A share of 0 draws nothing.
  bool happens(double share) { return share > 0.0 && uniform(0.0, 1.0) < share; }
  template <int N>
  Vec<N> gaussian_vector(double sigma) {
    Vec<N> v;
    for (int i = 0; i < N; ++i) v(i) = gaussian(sigma);
    return v;
  }

 private:
  std::mt19937_64 engine_;
  StandardNormal normal_;
};

}  // namespace equipoise
