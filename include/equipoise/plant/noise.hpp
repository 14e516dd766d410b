// Seeded noise, one independent stream per effect, so that switching one effect leaves the others' draws
// alone. Same seed, same numbers on one machine. Simulation only.
#pragma once

#include <cstdint>
#include <random>

#include "equipoise/types.hpp"

namespace equipoise {

class NoiseStream {
 public:
  NoiseStream(std::uint64_t seed, std::uint64_t effect)
      : engine_(mix(seed * 0x9E3779B97F4A7C15ULL + effect)) {}

  double gaussian(double sigma) { return sigma * normal_(engine_); }
  double uniform(double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>(0.0, 1.0)(engine_);
  }
  template <int N>
  Vec<N> gaussian_vector(double sigma) {
    Vec<N> v;
    for (int i = 0; i < N; ++i) v(i) = gaussian(sigma);
    return v;
  }

 private:
  /// splitmix64: neighbouring seeds give unrelated streams.
  static std::uint64_t mix(std::uint64_t z) noexcept {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }

  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_{0.0, 1.0};
};

}  // namespace equipoise
