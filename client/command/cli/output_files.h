#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::command {

/// Before a run, so that hours of it are not lost. Empty paths are left out. Errors: kUnavailable.
Result<void> CheckWritable(const std::vector<std::string>& paths);

/// Empty path: nothing. Errors: kUnavailable.
Result<void> WriteText(const std::string& path, const std::string& text);

}  // namespace taclink::command
