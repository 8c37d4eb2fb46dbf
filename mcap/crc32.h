#pragma once

#include <cstdint>

#include "mcap/bytes.h"

namespace taclink::mcap {

/// CRC-32 [crc32] (IEEE 802.3, as in zlib) of the bytes whose CRC is `before`, followed by `bytes`.
uint32_t Crc32(Bytes bytes, uint32_t before = 0);

/// CRC-32 of two runs of bytes one after the other, from the CRC of each and the length of the second.
/// Source: the CRC is a remainder modulo P(x), so that n bytes behind multiply it by x^8n mod P.
uint32_t Crc32Combine(uint32_t first, uint32_t second, uint64_t second_bytes);

}  // namespace taclink::mcap
