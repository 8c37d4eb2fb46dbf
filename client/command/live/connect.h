#pragma once

#include <chrono>
#include <string>

#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// As the options say that AddServerOption gives a command: `--server`, `--token`, `--tls-ca`, ...
Result<client::Client> ConnectTo(const std::string& server);

/// How long a stream may be silent on which the server says something once a second, if no option says it.
std::chrono::milliseconds SilencePatience();

}  // namespace taclink::command
