#pragma once

#include <cstdint>

namespace taclink {

/// The output function of SplitMix64 [steele2014]: turns counters into independent random numbers, so that a
/// frame's noise depends only on the seed and the frame's number.
constexpr uint64_t MixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// In [0, 1).
constexpr double UnitFromBits(uint64_t bits) {
  return static_cast<double>(bits >> 11) * 0x1.0p-53;
}

}  // namespace taclink
