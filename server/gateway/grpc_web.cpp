#include "server/gateway/grpc_web.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace taclink::server {
namespace {

constexpr size_t kHeadSize = 5;
constexpr uint8_t kCompressed = 0x01;
constexpr uint8_t kTrailers = 0x80;
constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, "the gRPC-Web body " + std::move(message)};
}

uint32_t ReadLength(std::string_view head) {
  uint32_t length = 0;
  for (size_t i = 1; i < kHeadSize; ++i) length = length << 8 | static_cast<uint8_t>(head[i]);
  return length;
}

std::string Frame(uint8_t flags, std::string_view payload) {
  std::string out;
  out.reserve(kHeadSize + payload.size());
  out += static_cast<char>(flags);
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(payload.size() >> shift & 0xff);
  return out.append(payload);
}

Result<std::vector<std::string>> DecodeFrames(std::string_view body) {
  std::vector<std::string> messages;
  while (!body.empty()) {
    if (body.size() < kHeadSize) return Invalid("ends within a frame's head");
    const auto flags = static_cast<uint8_t>(body[0]);
    const uint32_t length = ReadLength(body);
    body.remove_prefix(kHeadSize);
    if ((flags & kCompressed) != 0)
      return Error{ErrorCode::kUnsupported, "compressed gRPC-Web messages are not taken; send them plain"};
    if (flags != 0) return Invalid("has a frame that is no message");
    if (length > body.size()) return Invalid("ends within a message");
    messages.emplace_back(body.substr(0, length));
    body.remove_prefix(length);
  }
  return messages;
}

int ValueOf(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

}  // namespace

std::optional<WebFormat> WebFormatOf(std::string_view content_type) {
  content_type = content_type.substr(0, content_type.find(';'));
  while (content_type.ends_with(' ')) content_type.remove_suffix(1);
  if (content_type == "application/grpc-web" || content_type == "application/grpc-web+proto")
    return WebFormat::kBinary;
  if (content_type == "application/grpc-web-text" || content_type == "application/grpc-web-text+proto")
    return WebFormat::kText;
  return std::nullopt;
}

std::string_view ContentTypeOf(WebFormat format) {
  return format == WebFormat::kText ? "application/grpc-web-text+proto" : "application/grpc-web+proto";
}

bool IsMethodPath(std::string_view target) {
  if (target.size() < 4 || target.front() != '/') return false;
  target.remove_prefix(1);
  const auto slash = target.find('/');
  if (slash == std::string_view::npos || slash == 0 || slash + 1 == target.size()) return false;
  const auto good = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '.';
  };
  const auto service = target.substr(0, slash), method = target.substr(slash + 1);
  return std::all_of(service.begin(), service.end(), good) && std::all_of(method.begin(), method.end(), good);
}

Result<std::vector<std::string>> DecodeMessages(WebFormat format, std::string_view body) {
  if (format == WebFormat::kBinary) return DecodeFrames(body);
  const auto bytes = DecodeBase64(body);
  if (!bytes) return bytes.error();
  return DecodeFrames(*bytes);
}

std::string EncodeMessage(WebFormat format, std::string_view message) {
  const std::string frame = Frame(0, message);
  return format == WebFormat::kText ? EncodeBase64(frame) : frame;
}

std::string EncodeTrailers(WebFormat format, const WebStatus& status) {
  std::string text = "grpc-status: " + std::to_string(status.code) + "\r\n";
  if (!status.message.empty()) text += "grpc-message: " + PercentEncoded(status.message) + "\r\n";
  const std::string frame = Frame(kTrailers, text);
  return format == WebFormat::kText ? EncodeBase64(frame) : frame;
}

std::string PercentEncoded(std::string_view text) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<uint8_t>(c);
    if (byte >= 0x20 && byte < 0x7f && c != '%') {
      out += c;
    } else {
      out += {'%', kHex[byte >> 4], kHex[byte & 0xf]};
    }
  }
  return out;
}

std::optional<std::chrono::nanoseconds> ParseGrpcTimeout(std::string_view text) {
  constexpr size_t kMostDigits = 8;
  constexpr int64_t kLongestNs = int64_t{366} * 24 * 3600 * 1'000'000'000;
  constexpr std::array<std::pair<char, int64_t>, 6> kUnits = {{{'n', 1},
                                                               {'u', 1'000},
                                                               {'m', 1'000'000},
                                                               {'S', 1'000'000'000},
                                                               {'M', 60'000'000'000},
                                                               {'H', 3'600'000'000'000}}};
  if (text.size() < 2 || text.size() > kMostDigits + 1) return std::nullopt;
  const auto* const unit =
      std::find_if(kUnits.begin(), kUnits.end(), [&](const auto& each) { return each.first == text.back(); });
  int64_t count = 0;
  const char* const last = text.data() + text.size() - 1;
  const auto [end, error] = std::from_chars(text.data(), last, count);
  if (unit == kUnits.end() || error != std::errc() || end != last || count < 0) return std::nullopt;
  if (count > kLongestNs / unit->second) return std::nullopt;
  return std::chrono::nanoseconds(count * unit->second);
}

std::string EncodeBase64(std::string_view bytes) {
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    const size_t count = std::min<size_t>(3, bytes.size() - i);
    for (size_t j = 0; j < 3; ++j) group = group << 8 | (j < count ? static_cast<uint8_t>(bytes[i + j]) : 0U);
    for (size_t j = 0; j < 4; ++j) out += j <= count ? kAlphabet[group >> (18 - 6 * j) & 0x3f] : '=';
  }
  return out;
}

Result<std::string> DecodeBase64(std::string_view text) {
  if (text.size() % 4 != 0) return Invalid("is no base64: its length is no multiple of four");
  std::string out;
  out.reserve(text.size() / 4 * 3);
  for (size_t i = 0; i < text.size(); i += 4) {
    const size_t padding = text[i + 3] != '=' ? 0 : text[i + 2] != '=' ? 1 : 2;
    uint32_t group = 0;
    for (size_t j = 0; j < 4; ++j) {
      const int value = j < 4 - padding ? ValueOf(text[i + j]) : 0;
      if (value < 0) return Invalid("is no base64: it has another character");
      group = group << 6 | static_cast<uint32_t>(value);
    }
    for (size_t j = 0; j < 3 - padding; ++j) out += static_cast<char>(group >> (16 - 8 * j) & 0xff);
  }
  return out;
}

}  // namespace taclink::server
