#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

namespace taclink::server {

/// The process that listens on the socket file `path`; 0: one that can't be told; none: nobody does, though
/// the file may be there. gRPC replaces a socket file without a word, and who listened there is never reached
/// again.
std::optional<pid_t> ListenerOf(const std::string& path);

}  // namespace taclink::server
