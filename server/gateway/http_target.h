#pragma once

#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// The path of an HTTP request target, "/a%20b.js?x=1" -> "/a b.js". Pure, for bad input too. What is given
/// back begins with '/', and its parts are neither empty (but the last), nor begin with '.', nor hold '\\',
/// '/' or control characters: below a folder it stays there. Errors: kInvalidArgument.
Result<std::string> PathOfTarget(std::string_view target);

/// The media type of a file, by its name.
std::string_view ContentTypeOf(std::string_view path);

/// Whether an `accept-encoding` header ("gzip, deflate;q=0.5") takes gzip.
bool TakesGzip(std::string_view accept_encoding);

/// Whether a file's name holds a hash of its content ("index-BxX2a9Zk.js"), so that it never changes.
bool NameHoldsHash(std::string_view path);

/// Host and port of two addresses are the same page's: an `origin` header ("http://host:port") against a
/// `host` header.
bool SameOrigin(std::string_view origin, std::string_view host);

/// Whether a `host` header names this machine itself.
bool IsLoopbackHost(std::string_view host);

}  // namespace taclink::server
