#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::server {

/// Place of a link among `link_names`. Errors: kNotFound, with the names there are.
Result<size_t> FindLink(const std::vector<std::string>& link_names, const std::string& name);

}  // namespace taclink::server
