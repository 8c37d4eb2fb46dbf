#pragma once

#include <cstddef>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// Memory that a state keeps as long as somebody holds it, bytes: itself and its buffers.
size_t StateBytes(const LinkState& state);

}  // namespace taclink::server
