#include "server/gateway/page_origin.h"

#include <string>
#include <string_view>

#include "sensing/core/printable.h"
#include "server/gateway/http_target.h"

namespace taclink::server {
namespace {

constexpr size_t kMostShownBytes = 100;

std::string Shown(std::string_view text) {
  return "'" + Printable(text, kMostShownBytes) + "'";
}

// Each proxy on the way may have added one: the first is what the browser asked for.
std::string_view FirstOfList(std::string_view list) {
  list = list.substr(0, list.find(','));
  while (list.ends_with(' ')) list.remove_suffix(1);
  return list;
}

bool IsFromSamePage(const HttpRequest& request) {
  const std::string_view origin = request.Header("origin");
  return origin.empty() || SameOrigin(origin, request.Header("host")) ||
         SameOrigin(origin, FirstOfList(request.Header("x-forwarded-host"))) ||
         request.Header("sec-fetch-site") == "same-origin";
}

}  // namespace

std::optional<HttpFailure> ForeignPage(const HttpRequest& request, bool only_as_localhost) {
  const std::string_view host = request.Header("host");
  const bool has_no_host = request.http_1_0 && host.empty();
  if (only_as_localhost && !has_no_host && !IsLoopbackHost(host))
    return HttpFailure{421,
                       "without access tokens this server only answers as localhost, not as " + Shown(host) +
                           ". Configure security.tokens; or let the proxy send 'Host: localhost', and the "
                           "page's own host as X-Forwarded-Host (docs/proxies.md)"};
  const bool only_reads = request.method == "GET" || request.method == "HEAD";
  if (only_reads || IsFromSamePage(request)) return std::nullopt;
  return HttpFailure{421, "a page at " + Shown(request.Header("origin")) + " may not call the server at " +
                              Shown(host) +
                              ". Behind a proxy: let it pass the page's host on, in nginx by "
                              "'proxy_set_header X-Forwarded-Host $http_host;' (docs/proxies.md)"};
}

}  // namespace taclink::server
