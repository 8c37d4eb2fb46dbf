#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "mcap/bytes.h"
#include "sensing/core/result.h"

struct ZSTD_CCtx_s;

namespace taclink::mcap {

enum class Compression : uint8_t { kNone, kZstd, kLz4 };  ///< lz4: its frame format

/// As a chunk names it: "", "zstd", "lz4".
std::string_view NameOf(Compression compression);
/// Errors: kUnsupported.
Result<Compression> CompressionFrom(std::string_view name);

/// Compresses piece after piece with one context. For one thread at a time.
class Compressor {
 public:
  /// `level`: the library's; 0: its default.
  Compressor(Compression compression, int level);

  /// Replaces what is in `out`. kNone copies. Errors: kInternal (what the library says).
  Result<void> Compress(Bytes in, Buffer& out);

 private:
  struct Free {
    void operator()(ZSTD_CCtx_s* context) const;
  };
  const Compression compression_;
  const int level_;
  const std::unique_ptr<ZSTD_CCtx_s, Free> zstd_;
};

/// Replaces what is in `out` by the `size` bytes that `in` holds compressed. Before memory is taken `size`
/// must be one that `in` can hold at all. Errors: kInvalidArgument (damaged, or of another size).
Result<void> Decompress(Compression compression, Bytes in, uint64_t size, Buffer& out);

/// Replaces what is in `out` by what the frame at the beginning of `in` holds, at most `most` bytes, and
/// returns the frame's own length. Errors: kInvalidArgument (no frame, or none that says its size, or a
/// larger one), kUnavailable (it goes on behind `in`).
Result<size_t> DecompressFrame(Compression compression, Bytes in, uint64_t most, Buffer& out);

}  // namespace taclink::mcap
