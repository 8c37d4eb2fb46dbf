#pragma once

#include <optional>
#include <string>

#include "client/command/cli/json.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// Standard deviations of the three components; null: not known.
Json SigmasJson(const std::optional<client::Covariance3>& covariance, double scale);

/// One line; contacts and arrays with the same keys and units (mm, N) as `taclink solve --json`.
std::string FrameJson(const client::Frame& frame);

}  // namespace taclink::command
