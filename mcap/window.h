#pragma once

#include <algorithm>

#include "mcap/byte_source.h"

namespace taclink::mcap {

/// Reads small pieces that lie close together with few calls of the source.
class Window {
 public:
  static constexpr size_t kBytes = 64 << 10;

  explicit Window(const ByteSource& source) : source_(source) {}

  /// `size` bytes at `offset`, valid until the next call. Errors: as ByteSource::Read.
  Result<Bytes> Get(uint64_t offset, size_t size) {
    if (offset < start_ || offset + size > start_ + bytes_.size()) {
      const uint64_t rest = source_.size() - std::min(offset, source_.size());
      bytes_.resize(std::max(size, static_cast<size_t>(std::min<uint64_t>(rest, kBytes))));
      start_ = offset;
      if (const auto read = source_.Read(offset, bytes_); !read) {
        bytes_.clear();
        return read.error();
      }
    }
    return Bytes(bytes_).subspan(static_cast<size_t>(offset - start_), size);
  }

 private:
  const ByteSource& source_;
  Buffer bytes_;
  uint64_t start_ = 0;
};

}  // namespace taclink::mcap
