#include "server/gateway/http_target.h"

#include <algorithm>
#include <array>
#include <utility>

namespace taclink::server {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 17> kTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".webmanifest", "application/manifest+json"},
    {".txt", "text/plain; charset=utf-8"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".jpg", "image/jpeg"},
    {".ico", "image/x-icon"},
    {".webp", "image/webp"},
    {".woff2", "font/woff2"},
    {".wasm", "application/wasm"},
    {".glb", "model/gltf-binary"},
    {".pdf", "application/pdf"},
}};

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

Error Bad(const std::string& why) {
  return {ErrorCode::kInvalidArgument, "the request's path " + why};
}

bool IsAlnum(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

}  // namespace

Result<std::string> PathOfTarget(std::string_view target) {
  target = target.substr(0, target.find_first_of("?#"));
  if (target.empty() || target.front() != '/') return Bad("must begin with '/'");
  std::string path;
  for (size_t i = 0; i < target.size(); ++i) {
    char c = target[i];
    if (c == '%') {
      const int high = i + 1 < target.size() ? HexDigit(target[i + 1]) : -1;
      const int low = i + 2 < target.size() ? HexDigit(target[i + 2]) : -1;
      if (high < 0 || low < 0) return Bad("has a '%' without two hexadecimal digits");
      c = static_cast<char>(high * 16 + low);
      i += 2;
      if (c == '/') return Bad("has an encoded '/'");
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == '\\')
      return Bad("has a character that no file's name here has");
    const bool begins = !path.empty() && path.back() == '/';
    if (begins && (c == '.' || c == '/')) return Bad("has a part that is empty or begins with '.'");
    path += c;
  }
  return path;
}

std::string_view ContentTypeOf(std::string_view path) {
  for (const auto& [ending, type] : kTypes) {
    if (path.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

// As Vite names its files: NAME-HASH.EXTENSION, eight characters of hash.
bool TakesGzip(std::string_view accept_encoding) {
  while (!accept_encoding.empty()) {
    const size_t end = std::min(accept_encoding.find(','), accept_encoding.size());
    std::string_view item = accept_encoding.substr(0, end);
    accept_encoding.remove_prefix(std::min(end + 1, accept_encoding.size()));
    const size_t begin = std::min(item.find_first_not_of(' '), item.size());
    item.remove_prefix(begin);
    const std::string_view coding = item.substr(0, item.find_first_of("; "));
    const size_t weight = item.find("q=");
    if (coding == "gzip")
      return weight == std::string_view::npos ||
             item.find_first_not_of("0. ", weight + 2) != std::string_view::npos;
  }
  return false;
}

bool NameHoldsHash(std::string_view path) {
  constexpr size_t kHashSize = 8;
  path.remove_prefix(path.rfind('/') == std::string_view::npos ? 0 : path.rfind('/') + 1);
  const auto dot = path.find('.', 0);
  if (dot == std::string_view::npos || dot < kHashSize + 2 || path[dot - kHashSize - 1] != '-') return false;
  const std::string_view hash = path.substr(dot - kHashSize, kHashSize);
  const bool plain =
      std::all_of(hash.begin(), hash.end(), [](char c) { return IsAlnum(c) || c == '_' || c == '-'; });
  // A plain word of eight letters is no hash.
  return plain && std::any_of(hash.begin(), hash.end(), [](char c) { return c < 'a' || c > 'z'; });
}

bool SameOrigin(std::string_view origin, std::string_view host) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (origin.starts_with(scheme)) return origin.substr(scheme.size()) == host;
  }
  return false;
}

bool IsLoopbackHost(std::string_view host) {
  if (host.starts_with("[::1]")) {
    host.remove_prefix(5);
    return host.empty() || host.front() == ':';
  }
  const std::string_view name = host.substr(0, host.find(':'));
  if (name == "localhost") return true;
  const auto digit_or_dot = [](char c) { return (c >= '0' && c <= '9') || c == '.'; };
  return name.starts_with("127.") && std::all_of(name.begin(), name.end(), digit_or_dot);
}

}  // namespace taclink::server
