#include "equipoise/runtime/spsc_queue.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace equipoise::runtime {
namespace {

TEST(SpscQueue, RefusesWhenFullAndKeepsOrder) {
  SpscQueue<int> queue(4);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.push(i));
  EXPECT_FALSE(queue.push(4));
  for (int i = 0; i <= 4; ++i) {
    const int* oldest = queue.front();
    ASSERT_NE(oldest, nullptr);
    EXPECT_EQ(*oldest, i);
    if (i == 0) {
      EXPECT_FALSE(queue.push(4)) << "its place is free when it is dropped, not before";
    }
    queue.drop();
    if (i == 0) {
      EXPECT_TRUE(queue.push(4));
    }
  }
  EXPECT_EQ(queue.front(), nullptr);
}

TEST(SpscQueue, NothingIsLostOrReorderedBetweenThreads) {
  SpscQueue<int> queue(64);
  constexpr int kCount = 200000;
  std::thread producer([&] {
    for (int i = 0; i < kCount;) {
      if (queue.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  for (int expected = 0; expected < kCount;) {
    if (const int* value = queue.front()) {
      ASSERT_EQ(*value, expected);
      queue.drop();
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
}

}  // namespace
}  // namespace equipoise::runtime
