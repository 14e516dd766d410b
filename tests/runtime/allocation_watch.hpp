// Counts allocations and releases of this thread while one is in scope: operator new and delete, and the
// malloc family of everything linked into the test binary.
#pragma once

#include <cstdint>

class AllocationWatch {
 public:
  AllocationWatch();
  ~AllocationWatch();
  AllocationWatch(const AllocationWatch&) = delete;
  AllocationWatch& operator=(const AllocationWatch&) = delete;
  std::int64_t count() const;
};
