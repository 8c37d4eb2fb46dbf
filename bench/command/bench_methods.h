#pragma once

#include <string>
#include <vector>

#include "bench/force/force_method.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// Each of the force models on each of the meshes; no names: all, and "auto". Errors: kInvalidArgument (no
/// such force model).
Result<std::vector<ForceMethod>> ForceMethods(const std::vector<std::string>& names,
                                              const std::vector<int>& refinements);

}  // namespace taclink::command
