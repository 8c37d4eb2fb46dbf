#include "mcap/crc32.h"

#include <libdeflate.h>

#include <array>

namespace taclink::mcap {
namespace {

constexpr uint32_t kPolynomial = 0xEDB88320;  // bit 31 is x^0
constexpr uint32_t kOne = uint32_t{1} << 31;

constexpr uint32_t Multiply(uint32_t a, uint32_t b) {
  uint32_t product = 0;
  for (uint32_t bit = kOne; bit != 0; bit >>= 1) {
    if ((a & bit) != 0) product ^= b;
    b = (b & 1) != 0 ? b >> 1 ^ kPolynomial : b >> 1;
  }
  return product;
}

/// x^(8 * 2^i) mod P.
constexpr std::array<uint32_t, 64> kPowers = [] {
  std::array<uint32_t, 64> powers{};
  powers[0] = kOne >> 8;
  for (size_t i = 1; i < powers.size(); ++i) powers[i] = Multiply(powers[i - 1], powers[i - 1]);
  return powers;
}();

}  // namespace

uint32_t Crc32(Bytes bytes, uint32_t before) {
  // A null pointer would make libdeflate begin anew.
  return bytes.empty() ? before : libdeflate_crc32(before, bytes.data(), bytes.size());
}

uint32_t Crc32Combine(uint32_t first, uint32_t second, uint64_t second_bytes) {
  uint32_t factor = kOne;
  for (size_t i = 0; second_bytes != 0; ++i, second_bytes >>= 1) {
    if ((second_bytes & 1) != 0) factor = Multiply(factor, kPowers[i]);
  }
  return Multiply(first, factor) ^ second;
}

}  // namespace taclink::mcap
