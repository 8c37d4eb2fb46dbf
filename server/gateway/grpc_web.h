#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/core/result.h"

// The framing of gRPC-Web [grpcweb]: a body is frames of a flag byte, the length as big-endian
// u32, and so many bytes. Pure functions of bytes, for bad input too.
namespace taclink::server {

enum class WebFormat { kBinary, kText };  ///< kText: each piece of a body in base64

/// Of a request's `content-type`; none: it is no gRPC-Web that this gateway speaks.
std::optional<WebFormat> WebFormatOf(std::string_view content_type);
std::string_view ContentTypeOf(WebFormat format);

/// Whether a request target is a gRPC method, "/package.Service/Method".
bool IsMethodPath(std::string_view target);

/// The messages of a request's body. Errors: kInvalidArgument (not such frames), kUnsupported (compressed).
Result<std::vector<std::string>> DecodeMessages(WebFormat format, std::string_view body);

/// A message as a frame.
std::string EncodeMessage(WebFormat format, std::string_view message);

/// How a call ended, as gRPC numbers it.
struct WebStatus {
  int code = 0;
  std::string message;
};
/// The last frame of a body.
std::string EncodeTrailers(WebFormat format, const WebStatus& status);

/// As gRPC sends it in headers: printable ASCII but '%', the rest as %XX.
std::string PercentEncoded(std::string_view text);

/// Of a `grpc-timeout` header ("10S", "500m"); none: it is no such text, or longer than a year.
std::optional<std::chrono::nanoseconds> ParseGrpcTimeout(std::string_view text);

std::string EncodeBase64(std::string_view bytes);
/// Also pieces that were padded one by one. Errors: kInvalidArgument.
Result<std::string> DecodeBase64(std::string_view text);

}  // namespace taclink::server
