// The newest of many values from one thread to another; older ones are overwritten. Three places and an
// exchange: neither side ever waits. In: put() by one thread -> out: get() by one other. RT-safe on both
// sides.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace equipoise::runtime {

template <class T>
class LatestValue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit LatestValue(const T& first) { places_.fill(first); }

  void put(const T& value) noexcept {
    places_[writing_] = value;
    writing_ = between_.exchange(writing_ | kNew, std::memory_order_acq_rel) & kPlace;
  }
  const T& get() noexcept {
    if ((between_.load(std::memory_order_relaxed) & kNew) != 0)
      reading_ = between_.exchange(reading_, std::memory_order_acq_rel) & kPlace;
    return places_[reading_];
  }

 private:
  static constexpr std::uint32_t kPlace = 3;
  static constexpr std::uint32_t kNew = 4;

  std::array<T, 3> places_;
  std::uint32_t writing_ = 0;
  std::atomic<std::uint32_t> between_{1};
  std::uint32_t reading_ = 2;
};

}  // namespace equipoise::runtime
