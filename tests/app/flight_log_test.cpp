#include "app/log/flight_log.hpp"

#include <gtest/gtest.h>

#include <equipoise/run_t.hpp>
#include <limits>
#include <vector>

using equipoise::run_t;

namespace {
constexpr std::size_t kRobotLength = 32;  // hash, utime, seed, rolling radius come before

std::vector<std::uint8_t> encoded(const run_t& run) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(run.getEncodedSize()));
  run.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

int decoded(const std::vector<std::uint8_t>& bytes) {
  return bytes.size() < kRobotLength ? -1 : run_t().decode(bytes.data(), 0, static_cast<int>(bytes.size()));
}
}  // namespace

// Found by fuzzing: lcm-gen's own decoder throws (cmake/RefuseShortStrings.cmake).
TEST(RunRecord, AStringWithoutRoomForItsEndIsRefused) {
  run_t run{};
  run.robot = "mbbr";
  std::vector<std::uint8_t> bytes = encoded(run);
  ASSERT_EQ(decoded(bytes), static_cast<int>(bytes.size()));
  ASSERT_EQ(bytes[kRobotLength + 3], 5U);
  for (const std::int32_t length : {0, -1, -5, std::numeric_limits<std::int32_t>::min()}) {
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[kRobotLength + i] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(length) >> (24 - 8 * i));
    }
    EXPECT_LT(decoded(bytes), 0) << length;
  }
}
