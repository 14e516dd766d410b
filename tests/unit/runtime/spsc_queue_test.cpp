#include "equipoise/runtime/spsc_queue.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace equipoise::runtime {
namespace {

TEST(SpscQueue, RefusesWhenFullAndKeepsOrder) {
  SpscQueue<int> queue(4);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.push(i));
  EXPECT_FALSE(queue.push(4));
  int value = -1;
  EXPECT_TRUE(queue.pop(&value));
  EXPECT_EQ(value, 0);
  EXPECT_TRUE(queue.push(4));
  for (int i = 1; i <= 4; ++i) {
    EXPECT_TRUE(queue.pop(&value));
    EXPECT_EQ(value, i);
  }
  EXPECT_FALSE(queue.pop(&value));
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
    int value = -1;
    if (queue.pop(&value)) {
      ASSERT_EQ(value, expected);
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
}

}  // namespace
}  // namespace equipoise::runtime
