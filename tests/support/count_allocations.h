#pragma once

#include <atomic>
#include <cstddef>

/// Counts every malloc of the process, and so every operator new and all that Eigen takes. For a program of
/// its own, in one of its files; not beside a sanitizer, which has a malloc of its own.
namespace taclink {
inline std::atomic<long> allocations = 0;
}

extern "C" void* __libc_malloc(size_t size);  // NOLINT(bugprone-reserved-identifier): glibc's
extern "C" void* malloc(size_t size) {
  ++taclink::allocations;
  return __libc_malloc(size);
}
