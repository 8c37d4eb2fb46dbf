#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace taclink::testing {

enum class Http2Frame : uint8_t {
  kData = 0,
  kHeaders = 1,
  kPriority = 2,
  kReset = 3,
  kSettings = 4,
  kPing = 6,
  kWindowUpdate = 8,
  kContinuation = 9,
  kUnknown = 0x42,
};

/// One frame of HTTP/2 (RFC 9113, section 4.1), as a client sends it.
inline std::string Frame(Http2Frame type, uint8_t flags, uint32_t stream, std::string_view payload = {}) {
  const auto byte = [](size_t value) { return static_cast<char>(value & 0xff); };
  const size_t size = payload.size();
  std::string out = {byte(size >> 16), byte(size >> 8), byte(size), static_cast<char>(type),
                     static_cast<char>(flags)};
  for (const int shift : {24, 16, 8, 0}) out += byte(stream >> shift);
  return out.append(payload);
}

/// A header field without indexing (RFC 7541, section 6.2.2), of less than 127 bytes each.
inline std::string Field(std::string_view name, std::string_view value) {
  std::string out(1, '\0');
  out += static_cast<char>(name.size());
  out.append(name);
  out += static_cast<char>(value.size());
  return out.append(value);
}

/// The fields of a gRPC call.
inline std::string CallFields(std::string_view method) {
  return Field(":method", "POST") + Field(":scheme", "http") + Field(":path", method) +
         Field(":authority", "x") + Field("content-type", "application/grpc") + Field("te", "trailers");
}

/// What an HTTP/2 client begins with: the preface and empty settings.
inline std::string Preface() {
  return "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(Http2Frame::kSettings, 0, 0);
}

inline constexpr uint8_t kAck = 0x1, kEndStream = 0x1, kEndHeaders = 0x4;

}  // namespace taclink::testing
