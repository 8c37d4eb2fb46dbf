#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"
#include "server/config/config.h"

namespace taclink::server {

/// Whether what the configuration opens to other machines is guarded: TLS, and a token or a client's
/// certificate. Loud warnings where `insecure_open` lets it pass all the same. Errors: kInvalidArgument.
Result<std::vector<std::string>> CheckExposure(const Config& config, bool insecure_open);

}  // namespace taclink::server
