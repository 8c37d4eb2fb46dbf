#pragma once

namespace taclink {

/// Vector instruction sets of x86-64; each includes those before it.
enum class Instructions { kPlain, kAvx2, kAvx512 };

/// Kernels are compiled for each set; the best one that the processor supports is selected at run time.
inline Instructions BestInstructions() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("x86-64-v4")) return Instructions::kAvx512;
  if (__builtin_cpu_supports("x86-64-v3")) return Instructions::kAvx2;
#endif
  return Instructions::kPlain;
}

/// The variant of a kernel for the best instruction set.
template <typename Kernel>
Kernel BestOf(Kernel plain, Kernel avx2, Kernel avx512) {
  switch (BestInstructions()) {
    case Instructions::kAvx512:
      return avx512;
    case Instructions::kAvx2:
      return avx2;
    case Instructions::kPlain:
      break;
  }
  return plain;
}

#if defined(__x86_64__)
#define TACLINK_FOR_AVX2 __attribute__((target("arch=x86-64-v3")))
#define TACLINK_FOR_AVX512 __attribute__((target("arch=x86-64-v4")))
#else
#define TACLINK_FOR_AVX2
#define TACLINK_FOR_AVX512
#endif

/// For the functions that a kernel consists of: inlined, they are compiled for the kernel's instruction set.
/// They take vectors by reference, because passing them by value depends on the instruction set.
#define TACLINK_IN_KERNEL inline __attribute__((always_inline))

}  // namespace taclink
