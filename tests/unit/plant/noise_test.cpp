#include "equipoise/plant/noise.hpp"

#include <gtest/gtest.h>

namespace equipoise {
namespace {

/// A seed means what it has always meant.
TEST(StandardNormal, GivesTheNumbersOfLibstdcxx) {
#ifndef __GLIBCXX__
  GTEST_SKIP() << "another library draws other numbers";
#endif
  for (const std::uint64_t seed : {1ULL, 2ULL, 0x9E3779B97F4A7C15ULL}) {
    std::mt19937_64 ours(seed), theirs(seed);
    StandardNormal normal;
    std::normal_distribution<double> reference;
    for (int i = 0; i < 300000; ++i)
      ASSERT_EQ(normal(ours), reference(theirs)) << "seed " << seed << ", " << i;
  }
}

TEST(StandardNormal, ACopyGoesOnWithTheSameNumbers) {
  NoiseStream stream(3, 1);
  for (int i = 0; i < 100; ++i) stream.gaussian(1.0);
  NoiseStream copy = stream;
  for (int i = 0; i < 100; ++i) ASSERT_EQ(copy.gaussian(2.0), stream.gaussian(2.0));
}

}  // namespace
}  // namespace equipoise
