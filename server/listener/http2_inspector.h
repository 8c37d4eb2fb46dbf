#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "server/listener/token_bucket.h"

namespace taclink::server {

/// What a client may do on one HTTP/2 connection.
struct Http2Limits {
  size_t header_bytes = size_t{64} << 10;  ///< of one header block: HEADERS and its CONTINUATION frames
  int continuations = 8;                   ///< CONTINUATION frames of one header block
  double reset_burst = 4000, resets_per_s = 2000;
  double control_burst = 1000, controls_per_s = 200;  ///< SETTINGS, PRIORITY, empty frames; gRPC bounds PING
  // Until an authorized call was received:
  double call_burst = 200, calls_per_s = 40;
  double frame_burst = 5000, frames_per_s = 1000;  ///< of any kind
};

/// Follows the frames that a client sends (RFC 9113, section 4.1) and finds those that cost the server more
/// than the client. gRPC 1.51 bounds a header block only frame by frame (CVE-2023-33953) and does not count
/// streams that the client resets at once (CVE-2023-44487), so that a connection without a token can take all
/// memory. Reads frame headers only: no header compression, no content. One thread at a time.
class Http2Inspector {
 public:
  explicit Http2Inspector(const Http2Limits& limits = {});

  /// The next bytes that the client has sent, from the connection preface on. False: the connection must end,
  /// violation() says why; so it stays. Bytes that are not HTTP/2 at all pass: gRPC refuses them.
  /// `authorized`: an authorized call was received over the connection.
  bool Feed(std::span<const std::byte> bytes, int64_t now_ns, bool authorized = false);
  /// For people; empty: none.
  const std::string& violation() const { return violation_; }

 private:
  enum class FrameType : uint8_t {
    kData = 0,
    kHeaders = 1,
    kPriority = 2,
    kResetStream = 3,
    kSettings = 4,
    kPushPromise = 5,
    kPing = 6,
    kGoAway = 7,
    kWindowUpdate = 8,
    kContinuation = 9,
  };
  static constexpr size_t kHeaderBytes = 9, kPrefaceBytes = 24, kIncrementBytes = 4;

  bool OnFrame(int64_t now_ns, bool authorized);
  bool OnHeaders(size_t length, bool ends, int64_t now_ns, bool authorized);
  bool OnHeaderBlock(size_t length, bool ends);
  bool OnWindowUpdate(int64_t now_ns);
  bool Spend(TokenBucket& bucket, int64_t now_ns, const char* what, double per_s);
  bool Refuse(std::string why);

  const Http2Limits limits_;
  TokenBucket resets_, controls_, calls_, frames_;
  size_t preface_left_ = kPrefaceBytes;
  std::array<uint8_t, kHeaderBytes + kIncrementBytes>
      header_{};            // of the frame; with a WINDOW_UPDATE's payload
  size_t header_size_ = 0;  // bytes of it that were read
  size_t payload_left_ = 0;
  size_t block_bytes_ = 0;  // of the open header block
  int continuations_ = 0;   // likewise
  std::string violation_;
};

}  // namespace taclink::server
