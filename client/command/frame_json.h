#pragma once

#include <string>

#include "client/taclink/client.h"

namespace taclink::command {

/// One line; contacts and arrays with the same keys and units (mm, N) as `taclink solve --json`.
std::string FrameJson(const client::Frame& frame);

}  // namespace taclink::command
