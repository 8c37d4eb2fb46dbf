// The body of a gRPC-Web request, and the texts of its headers.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "server/gateway/grpc_web.h"

using namespace taclink::server;

namespace {

// What is read, sent and read again stays the same.
void CheckBody(WebFormat format, std::string_view body) {
  const auto messages = DecodeMessages(format, body);
  if (!messages) {
    if (messages.error().message.empty()) std::abort();
    return;
  }
  std::string sent;
  for (const std::string& message : *messages) sent += EncodeMessage(format, message);
  const auto again = DecodeMessages(format, sent);
  if (!again || *again != *messages) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  CheckBody(WebFormat::kBinary, text);
  CheckBody(WebFormat::kText, text);
  const auto bytes = DecodeBase64(text);
  if (bytes) {
    const auto again = DecodeBase64(EncodeBase64(*bytes));
    if (!again || *again != *bytes) std::abort();
  }
  const auto timeout = ParseGrpcTimeout(text);
  if (timeout && timeout->count() < 0) std::abort();
  static_cast<void>(WebFormatOf(text));
  static_cast<void>(IsMethodPath(text));
  // A status text ends within its line.
  const std::string trailers = EncodeTrailers(WebFormat::kBinary, {13, std::string(text)});
  const std::string_view lines = std::string_view(trailers).substr(5);
  size_t ends = 0;
  for (const char c : lines) ends += c == '\n' ? 1 : 0;
  if (lines.size() < 2 || lines.substr(lines.size() - 2) != "\r\n" || ends != 1 + (size > 0 ? 1 : 0))
    std::abort();
  return 0;
}
