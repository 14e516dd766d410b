#include "allocation_watch.hpp"

#include <cstddef>
#include <cstdlib>
#include <new>

namespace {
thread_local bool watching = false;
thread_local std::int64_t calls = 0;

void note() {
  if (watching) ++calls;
}
}  // namespace

AllocationWatch::AllocationWatch() {
  calls = 0;
  watching = true;
}
AllocationWatch::~AllocationWatch() { watching = false; }
std::int64_t AllocationWatch::count() const { return calls; }

// The linker sends every call of the binary's own objects to __wrap_*.
extern "C" {
void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* block, std::size_t size);
void* __real_aligned_alloc(std::size_t alignment, std::size_t size);
int __real_posix_memalign(void** out, std::size_t alignment, std::size_t size);
void __real_free(void* block);

void* __wrap_malloc(std::size_t size) {
  note();
  return __real_malloc(size);
}
void* __wrap_calloc(std::size_t count, std::size_t size) {
  note();
  return __real_calloc(count, size);
}
void* __wrap_realloc(void* block, std::size_t size) {
  note();
  return __real_realloc(block, size);
}
void* __wrap_aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __real_aligned_alloc(alignment, size);
}
int __wrap_posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  note();
  return __real_posix_memalign(out, alignment, size);
}
void __wrap_free(void* block) {
  note();
  __real_free(block);
}
}

// The array, nothrow and sized forms come down to these.
void* operator new(std::size_t size) {
  void* block = std::malloc(size);
  if (block == nullptr) throw std::bad_alloc();
  return block;
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto a = static_cast<std::size_t>(alignment);
  void* block = std::aligned_alloc(a, (size + a - 1) / a * a);
  if (block == nullptr) throw std::bad_alloc();
  return block;
}
void operator delete(void* block) noexcept { std::free(block); }
void operator delete(void* block, std::size_t) noexcept { std::free(block); }
void operator delete(void* block, std::align_val_t) noexcept { std::free(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { std::free(block); }
