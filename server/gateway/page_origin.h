#pragma once

#include <optional>

#include "server/gateway/http_message.h"

namespace taclink::server {

/// Why a request may come from a page of another site, as a response; none: it may be answered. Pure.
///
/// A call (any method but GET and HEAD, whose answers a foreign page cannot read) with an `origin` must come
/// from a page at the address that was asked: the `host` header, or, behind a proxy that replaces it, the
/// `x-forwarded-host` header; or the browser itself says so (`sec-fetch-site: same-origin`). A foreign page
/// can set neither of the two without the permission of this server, which never gives it (CORS).
///
/// `only_as_localhost`: nothing but the loopback address guards the server. A foreign name that was made to
/// point here must not let that site's pages in, so that `host` must name this machine. Only HTTP/1.0 has no
/// `host` header; browsers do not speak it.
std::optional<HttpFailure> ForeignPage(const HttpRequest& request, bool only_as_localhost);

}  // namespace taclink::server
