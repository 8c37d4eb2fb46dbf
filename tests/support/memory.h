#pragma once

#include <malloc.h>

#include <fstream>
#include <string>

namespace taclink::testing {

#if !defined(__has_feature)
#define __has_feature(feature) 0  // clang's
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || __has_feature(address_sanitizer)
inline constexpr bool kSanitized = true;  // freed memory is kept for a while: sizes say nothing
#else
inline constexpr bool kSanitized = false;
#endif

/// Memory of this process, MB, without what the allocator could give back.
inline double ResidentMb() {
  malloc_trim(0);
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kb = 0;
    if (word == "VmRSS:" && status >> kb) return kb / 1024;
  }
  return 0;
}

}  // namespace taclink::testing
