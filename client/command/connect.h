#pragma once

#include <string>

#include "client/taclink/client.h"

namespace taclink::command {

/// As the options say that AddServerOption gives a command: `--server`, `--token`, `--tls-ca`, ...
Result<client::Client> ConnectTo(const std::string& server);

}  // namespace taclink::command
