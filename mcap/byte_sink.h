#pragma once

#include <cstdint>

#include "mcap/bytes.h"
#include "sensing/core/result.h"

namespace taclink::mcap {

/// Where a log's bytes go, in order.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  /// Appends all pieces. After an error any part of them may be there, until Truncate removes it.
  virtual Result<void> Append(std::span<const Bytes> pieces) = 0;
  /// Returns when what was appended would outlast a power cut.
  virtual Result<void> Sync() = 0;
  /// Cuts off all behind `position`. Errors: kUnsupported (a pipe), or the system's.
  virtual Result<void> Truncate(uint64_t position) = 0;
  /// Bytes of all calls of Append that succeeded.
  virtual uint64_t position() const = 0;
};

/// Memory.
class BufferSink : public ByteSink {
 public:
  Result<void> Append(std::span<const Bytes> pieces) override {
    for (const Bytes piece : pieces) AppendBytes(piece, bytes_);
    return {};
  }
  Result<void> Sync() override { return {}; }
  Result<void> Truncate(uint64_t position) override {
    bytes_.resize(static_cast<size_t>(position));
    return {};
  }
  uint64_t position() const override { return bytes_.size(); }
  const Buffer& bytes() const { return bytes_; }

 private:
  Buffer bytes_;
};

}  // namespace taclink::mcap
