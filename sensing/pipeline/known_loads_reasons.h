#pragma once

#include "sensing/pipeline/judge.h"

namespace taclink {

/// Adds why the known loads (gauge pressure, specific force) cannot be trusted: not measured, or contradicted
/// by the shape of the skin.
void AddKnownLoadsReasons(const Evidence& evidence, LinkState& state);

}  // namespace taclink
