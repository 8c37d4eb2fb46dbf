#include "mcap/compression.h"

#include <lz4frame.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <string>

namespace taclink::mcap {
namespace {

Error Damaged(std::string what) {
  return {ErrorCode::kInvalidArgument, std::move(what)};
}

/// The most that `in` can hold: of zstd a repeated block, 4 bytes for 128 KiB; of lz4 a match, 255 for each
/// byte.
bool CanHold(Compression compression, size_t in, uint64_t size) {
  constexpr uint64_t kZstdBlock = 128 << 10;
  const uint64_t most =
      compression == Compression::kZstd ? (in / 4 + 1) * kZstdBlock : (in + 1) * uint64_t{255};
  return size <= most;
}

Result<void> DecompressZstd(Bytes in, Buffer& out) {
  struct Free {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  thread_local const std::unique_ptr<ZSTD_DCtx, Free> context(ZSTD_createDCtx());
  if (!context) return Error{ErrorCode::kResourceExhausted, "no memory for zstd"};
  const size_t size = ZSTD_decompressDCtx(context.get(), out.data(), out.size(), in.data(), in.size());
  if (ZSTD_isError(size) != 0) return Damaged(std::string("zstd: ") + ZSTD_getErrorName(size));
  if (size != out.size()) {
    return Damaged("zstd holds " + std::to_string(size) + " bytes, not " + std::to_string(out.size()));
  }
  return {};
}

/// Returns how much of `in` the frame takes.
Result<size_t> DecompressLz4Frame(Bytes in, Buffer& out) {
  struct Free {
    void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
  };
  thread_local const std::unique_ptr<LZ4F_dctx, Free> context([] {
    LZ4F_dctx* created = nullptr;
    LZ4F_createDecompressionContext(&created, LZ4F_VERSION);
    return created;
  }());
  if (!context) return Error{ErrorCode::kResourceExhausted, "no memory for lz4"};
  LZ4F_resetDecompressionContext(context.get());
  size_t taken = 0;
  size_t made = 0;
  for (size_t hint = 1; hint != 0;) {
    size_t source = in.size() - taken;
    size_t target = out.size() - made;
    hint = LZ4F_decompress(context.get(), out.data() + made, &target, in.data() + taken, &source, nullptr);
    if (LZ4F_isError(hint) != 0) return Damaged(std::string("lz4: ") + LZ4F_getErrorName(hint));
    if (hint != 0 && source == 0 && target == 0) {
      const bool is_cut = taken == in.size();
      return Error{is_cut ? ErrorCode::kUnavailable : ErrorCode::kInvalidArgument,
                   "lz4 is cut off or holds more than its size"};
    }
    taken += source;
    made += target;
  }
  if (made != out.size())
    return Damaged("lz4 holds " + std::to_string(made) + " bytes, not " + std::to_string(out.size()));
  return taken;
}

Result<void> DecompressLz4(Bytes in, Buffer& out) {
  const auto taken = DecompressLz4Frame(in, out);
  if (!taken) return Damaged(taken.error().message);
  if (*taken != in.size()) return Damaged("lz4 ends " + std::to_string(in.size() - *taken) + " bytes early");
  return {};
}

/// Of the uncompressed content, as a frame's head says; 0: it does not.
uint64_t Lz4ContentSize(Bytes in) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return 0;
  LZ4F_frameInfo_t info{};
  size_t size = in.size();
  const bool good = LZ4F_isError(LZ4F_getFrameInfo(context, &info, in.data(), &size)) == 0;
  LZ4F_freeDecompressionContext(context);
  return good ? info.contentSize : 0;
}

}  // namespace

void Compressor::Free::operator()(ZSTD_CCtx_s* context) const {
  ZSTD_freeCCtx(context);
}

std::string_view NameOf(Compression compression) {
  switch (compression) {
    case Compression::kNone:
      return "";
    case Compression::kZstd:
      return "zstd";
    case Compression::kLz4:
      return "lz4";
  }
  return "";
}

Result<Compression> CompressionFrom(std::string_view name) {
  for (const auto compression : {Compression::kNone, Compression::kZstd, Compression::kLz4}) {
    if (NameOf(compression) == name) return compression;
  }
  return Error{ErrorCode::kUnsupported, "chunks compressed by '" + std::string(name.substr(0, 32)) +
                                            "' are not supported; use zstd, lz4 or none"};
}

Compressor::Compressor(Compression compression, int level)
    : compression_(compression),
      level_(level),
      zstd_(compression == Compression::kZstd ? ZSTD_createCCtx() : nullptr) {}

Result<void> Compressor::Compress(Bytes in, Buffer& out) {
  if (compression_ == Compression::kNone) {
    out.assign(in.begin(), in.end());
    return {};
  }
  if (compression_ == Compression::kZstd) {
    out.resize(ZSTD_compressBound(in.size()));
    const size_t size = ZSTD_compressCCtx(zstd_.get(), out.data(), out.size(), in.data(), in.size(), level_);
    if (ZSTD_isError(size) != 0)
      return Error{ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(size)};
    out.resize(size);
    return {};
  }
  LZ4F_preferences_t preferences{};
  preferences.compressionLevel = level_;
  preferences.frameInfo.contentSize = in.size();
  preferences.frameInfo.blockSizeID = LZ4F_max4MB;
  out.resize(LZ4F_compressFrameBound(in.size(), &preferences));
  const size_t size = LZ4F_compressFrame(out.data(), out.size(), in.data(), in.size(), &preferences);
  if (LZ4F_isError(size) != 0)
    return Error{ErrorCode::kInternal, std::string("lz4: ") + LZ4F_getErrorName(size)};
  out.resize(size);
  return {};
}

Result<void> Decompress(Compression compression, Bytes in, uint64_t size, Buffer& out) {
  if (compression == Compression::kNone) {
    if (in.size() != size) return Damaged("an uncompressed chunk is not of its own size");
    out.assign(in.begin(), in.end());
    return {};
  }
  if (!CanHold(compression, in.size(), size)) {
    return Damaged(std::to_string(in.size()) + " bytes of " + std::string(NameOf(compression)) +
                   " can't hold " + std::to_string(size));
  }
  out.resize(static_cast<size_t>(size));
  if (in.empty()) return size == 0 ? Result<void>() : Damaged("a compressed chunk is empty");
  return compression == Compression::kZstd ? DecompressZstd(in, out) : DecompressLz4(in, out);
}

Result<size_t> DecompressFrame(Compression compression, Bytes in, uint64_t most, Buffer& out) {
  const bool is_zstd = compression == Compression::kZstd;
  const uint64_t size = is_zstd ? ZSTD_getFrameContentSize(in.data(), in.size()) : Lz4ContentSize(in);
  if (size == 0 || size > most) return Damaged("a frame without a size, or too large");  // also zstd's errors
  const size_t frame = is_zstd ? ZSTD_findFrameCompressedSize(in.data(), in.size()) : in.size();
  if (is_zstd && ZSTD_isError(frame) != 0) {
    const bool is_cut = ZSTD_getErrorCode(frame) == ZSTD_error_srcSize_wrong;
    return Error{is_cut ? ErrorCode::kUnavailable : ErrorCode::kInvalidArgument,
                 std::string("zstd: ") + ZSTD_getErrorName(frame)};
  }
  if (is_zstd && !CanHold(compression, frame, size)) return Damaged("a frame that can't hold its size");
  out.resize(static_cast<size_t>(size));
  if (!is_zstd) return DecompressLz4Frame(in, out);
  if (const auto done = DecompressZstd(in.first(frame), out); !done) return done.error();
  return frame;
}

}  // namespace taclink::mcap
