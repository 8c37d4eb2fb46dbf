// An HTTP connection's bytes, and what is made of a request.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "server/gateway/http_message.h"
#include "server/gateway/http_target.h"
#include "server/gateway/page_origin.h"

using namespace taclink::server;

namespace {

constexpr size_t kManyRequests = 64;

struct Heard {
  std::vector<HttpRequest> requests;
  int failure = 0;  // HTTP status; 0: none
};

// As a session does, with the bytes coming `piece` at a time.
Heard Hear(std::string_view bytes, size_t piece) {
  HttpRequestParser parser({.header_bytes = 512, .body_bytes = 512});
  Heard heard;
  std::string waiting;
  for (size_t at = 0; at < bytes.size() && heard.requests.size() < kManyRequests; at += piece) {
    waiting += bytes.substr(at, piece);
    for (size_t used = 1; used > 0;) {
      used = parser.Feed(waiting);
      if (used > waiting.size()) std::abort();
      waiting.erase(0, used);
      if (parser.failure()) {
        heard.failure = parser.failure()->status;
        return heard;
      }
      if (!parser.Done()) continue;
      heard.requests.push_back(parser.Take());
      used = 1;
    }
  }
  return heard;
}

void CheckPath(std::string_view target) {
  const auto path = PathOfTarget(target);
  if (!path) return;
  const std::string inside = *path + "/";
  if (path->front() != '/' || inside.find("/.") != std::string::npos ||
      inside.find('\\') != std::string::npos ||
      std::any_of(path->begin(), path->end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }))
    std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  // Of a head that comes in pieces, errors are only found at its end.
  const std::string bytes = std::string(reinterpret_cast<const char*>(data) + 1, size - 1) + "\r\n\r\n";
  const Heard whole = Hear(bytes, bytes.size());
  const Heard pieces = Hear(bytes, size_t{1} + data[0] % 32);
  if (whole.requests.size() != pieces.requests.size() || (whole.failure != 0) != (pieces.failure != 0))
    std::abort();
  for (size_t i = 0; i < whole.requests.size(); ++i) {
    const HttpRequest &one = whole.requests[i], &other = pieces.requests[i];
    if (one.target != other.target || one.method != other.method || one.headers != other.headers ||
        one.body != other.body || one.keep_alive != other.keep_alive)
      std::abort();
    if (one.body.size() > 512) std::abort();
    CheckPath(one.target);
    static_cast<void>(ForeignPage(one, true));
    static_cast<void>(NameHoldsHash(one.target));
  }
  CheckPath(std::string_view(bytes).substr(0, size - 1));
  return 0;
}
