#pragma once

#include <cstdint>
#include <cstring>

namespace taclink {

/// Eight or sixteen neighbouring pixels at once, in whatever vector registers the machine has.
using Bytes16 [[gnu::vector_size(16)]] = uint8_t;
using Shorts8 [[gnu::vector_size(16)]] = uint16_t;
using SignedShorts8 [[gnu::vector_size(16)]] = int16_t;
using Longs2 [[gnu::vector_size(16)]] = uint64_t;
using Ints4 [[gnu::vector_size(16)]] = int32_t;
using Floats4 [[gnu::vector_size(16)]] = float;

inline Bytes16 LoadSixteen(const uint8_t* p) {
  Bytes16 sixteen;
  std::memcpy(&sixteen, p, sizeof sixteen);
  return sixteen;
}

inline uint64_t LoadEight(const uint8_t* p) {
  uint64_t eight = 0;
  std::memcpy(&eight, p, sizeof eight);
  return eight;
}

inline Shorts8 LoadShorts(const uint16_t* p) {
  Shorts8 eight;
  std::memcpy(&eight, p, sizeof eight);
  return eight;
}

inline Shorts8 EightShorts(uint64_t bytes) {
  const auto eight = reinterpret_cast<Bytes16>(Longs2{bytes, 0});
  return reinterpret_cast<Shorts8>(
      __builtin_shufflevector(eight, Bytes16{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23));
}

inline bool Any(Longs2 lanes) {
  return (lanes[0] | lanes[1]) != 0;
}

/// The lowest four bytes as numbers.
inline Floats4 FourFloats(uint64_t bytes) {
  const auto four = reinterpret_cast<Bytes16>(Longs2{bytes, 0});
  const Bytes16 zero{};
  const auto pairs =
      __builtin_shufflevector(four, zero, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const auto wide =
      __builtin_shufflevector(pairs, zero, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
  return __builtin_convertvector(reinterpret_cast<Ints4>(wide), Floats4);
}

/// Eight gray levels as numbers.
struct Floats8 {
  Floats4 low, high;

  explicit Floats8(const uint8_t* p) : low(FourFloats(LoadEight(p))), high(FourFloats(LoadEight(p) >> 32)) {}
};

/// Each between 0 and 1.
inline Floats4 Clamped(Floats4 v) {
  const Floats4 zero{}, one = zero + 1;
  v = v > zero ? v : zero;
  return v < one ? v : one;
}

/// Which of eight pixels are brighter than a level (0 to 254), one bit each.
inline uint64_t Brighter(uint64_t eight, int level) {
  constexpr uint64_t kOnes = 0x0101010101010101ULL, kTops = 0x8080808080808080ULL;
  const uint64_t low = eight & ~kTops;
  const uint64_t above = low + kOnes * static_cast<uint64_t>(level < 128 ? 127 - level : 255 - level);
  const uint64_t flags = (level < 128 ? above | eight : above & eight) & kTops;
  return (flags >> 7) * 0x0102040810204080ULL >> 56;
}

/// 255 in the byte of each set bit of the lowest eight.
inline uint64_t SpreadBits(uint64_t eight) {
  const uint64_t picked = (eight & 255) * 0x0101010101010101ULL & 0x8040201008040201ULL;
  return (((picked + 0x7f7f7f7f7f7f7f7fULL) | picked) >> 7 & 0x0101010101010101ULL) * 255;
}

}  // namespace taclink
