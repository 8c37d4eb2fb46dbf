#pragma once

#include <string>
#include <vector>

#include "server/hub/hub.h"

namespace taclink::server {

/// The API's bytes of a state of the arm's links, named by index.
FrameEncoder MakeEncoder(const std::vector<std::string>& link_names);

}  // namespace taclink::server
