#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace taclink::mcap {

using Bytes = std::span<const std::byte>;
using Buffer = std::vector<std::byte>;

inline Bytes AsBytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}
inline std::string_view AsText(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Takes little-endian numbers and strings off the front of untrusted bytes. What reaches past the end gives
/// zero or nothing and sets failed(), so that one look after the last field is enough.
class ByteReader {
 public:
  explicit ByteReader(Bytes bytes) : rest_(bytes) {}

  bool failed() const { return failed_; }
  bool done() const { return failed_ || rest_.empty(); }
  size_t remaining() const { return rest_.size(); }

  template <std::unsigned_integral T>
  T Number() {
    const Bytes bytes = Take(sizeof(T));
    uint64_t value = 0;
    for (size_t i = bytes.size(); i > 0; --i) value = value << 8 | std::to_integer<uint64_t>(bytes[i - 1]);
    return static_cast<T>(value);
  }
  Bytes Take(uint64_t size) {
    if (size > rest_.size()) {
      failed_ = true;
      rest_ = {};
      return {};
    }
    const Bytes taken = rest_.first(static_cast<size_t>(size));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  /// With the length before it, as T.
  template <std::unsigned_integral T>
  Bytes Sized() {
    return Take(Number<T>());
  }
  std::string String() { return std::string(AsText(Sized<uint32_t>())); }

 private:
  Bytes rest_;
  bool failed_ = false;
};

inline void AppendBytes(Bytes bytes, Buffer& out) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

template <std::unsigned_integral T>
std::array<std::byte, sizeof(T)> LittleEndian(T value) {
  std::array<std::byte, sizeof(T)> bytes{};
  for (size_t i = 0; i < sizeof(T); ++i) bytes[i] = static_cast<std::byte>(uint64_t{value} >> (8 * i));
  return bytes;
}

template <std::unsigned_integral T>
void AppendNumber(T value, Buffer& out) {
  AppendBytes(LittleEndian(value), out);
}

/// Overwrites a number that was appended at `offset`.
template <std::unsigned_integral T>
void PutNumber(T value, size_t offset, Buffer& out) {
  const auto bytes = LittleEndian(value);
  std::copy(bytes.begin(), bytes.end(), out.begin() + static_cast<ptrdiff_t>(offset));
}

inline void AppendString(std::string_view text, Buffer& out) {
  AppendNumber(static_cast<uint32_t>(text.size()), out);
  AppendBytes(AsBytes(text), out);
}

}  // namespace taclink::mcap
