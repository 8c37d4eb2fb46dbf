#include "server/listener/http2_inspector.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace taclink::server {
namespace {

constexpr uint8_t kAck = 0x1, kEndStream = 0x1, kEndHeaders = 0x4;

}  // namespace

Http2Inspector::Http2Inspector(const Http2Limits& limits)
    : limits_(limits),
      resets_(limits.reset_burst, limits.resets_per_s),
      controls_(limits.control_burst, limits.controls_per_s),
      calls_(limits.call_burst, limits.calls_per_s),
      frames_(limits.frame_burst, limits.frames_per_s) {}

bool Http2Inspector::Refuse(std::string why) {
  violation_ = std::move(why);
  return false;
}

bool Http2Inspector::Feed(std::span<const std::byte> bytes, int64_t now_ns, bool authorized) {
  if (!violation_.empty()) return false;
  const auto skip = [&bytes](size_t& left) {
    const size_t taken = std::min(left, bytes.size());
    left -= taken;
    bytes = bytes.subspan(taken);
  };
  skip(preface_left_);
  while (!bytes.empty()) {
    if (payload_left_ > 0) {
      skip(payload_left_);
      continue;
    }
    header_[header_size_++] = std::to_integer<uint8_t>(bytes.front());
    bytes = bytes.subspan(1);
    const bool has_increment =
        header_size_ >= kHeaderBytes && header_[3] == static_cast<uint8_t>(FrameType::kWindowUpdate);
    if (header_size_ < (has_increment ? header_.size() : kHeaderBytes)) continue;
    if (!OnFrame(now_ns, authorized)) return false;
    header_size_ = 0;
  }
  return true;
}

bool Http2Inspector::OnFrame(int64_t now_ns, bool authorized) {
  const size_t length = size_t{header_[0]} << 16 | size_t{header_[1]} << 8 | header_[2];
  const uint8_t flags = header_[4];
  payload_left_ = length;
  if (!authorized && !Spend(frames_, now_ns, "frames without an authorized call", limits_.frames_per_s))
    return false;
  switch (static_cast<FrameType>(header_[3])) {
    case FrameType::kHeaders:
      return OnHeaders(length, (flags & kEndHeaders) != 0, now_ns, authorized);
    case FrameType::kContinuation:
      if (++continuations_ > limits_.continuations)
        return Refuse(
            fmt::format("a header block in more than {} CONTINUATION frames", limits_.continuations));
      return OnHeaderBlock(length, (flags & kEndHeaders) != 0);
    case FrameType::kResetStream:
      return Spend(resets_, now_ns, "streams that the client resets", limits_.resets_per_s);
    case FrameType::kWindowUpdate:
      return OnWindowUpdate(now_ns);
    case FrameType::kData:
      if (length > 0 || (flags & kEndStream) != 0) return true;
      break;
    case FrameType::kSettings:
      if ((flags & kAck) != 0) return true;  // costs nothing, and the server has asked for it
      break;
    case FrameType::kPing:
      return true;  // gRPC ends the connection where they are too many; grpc-go sends one for each DATA frame
    default:
      break;
  }
  return Spend(controls_, now_ns, "SETTINGS, PRIORITY or empty frames", limits_.controls_per_s);
}

bool Http2Inspector::OnHeaders(size_t length, bool ends, int64_t now_ns, bool authorized) {
  block_bytes_ = 0;
  continuations_ = 0;
  if (!authorized && !Spend(calls_, now_ns, "calls without an authorized one", limits_.calls_per_s))
    return false;
  return OnHeaderBlock(length, ends);
}

bool Http2Inspector::OnHeaderBlock(size_t length, bool ends) {
  block_bytes_ += length;
  if (block_bytes_ > limits_.header_bytes)
    return Refuse(fmt::format("a header block of {} bytes or more; at most {} may be sent", block_bytes_,
                              limits_.header_bytes));
  if (ends) block_bytes_ = 0;
  return true;
}

// An increment of 0 is an error for which the server resets the stream: as if the client did.
bool Http2Inspector::OnWindowUpdate(int64_t now_ns) {
  payload_left_ -= std::min(payload_left_, kIncrementBytes);
  const bool is_zero =
      std::all_of(header_.begin() + kHeaderBytes, header_.end(), [](uint8_t byte) { return byte == 0; });
  // Others are not bounded once the connection is authorized: who reads fast sends two for each message.
  return !is_zero ||
         Spend(resets_, now_ns, "streams that an empty WINDOW_UPDATE resets", limits_.resets_per_s);
}

bool Http2Inspector::Spend(TokenBucket& bucket, int64_t now_ns, const char* what, double per_s) {
  if (bucket.Take(now_ns)) return true;
  return Refuse(fmt::format("more than {} {} per second", per_s, what));
}

}  // namespace taclink::server
