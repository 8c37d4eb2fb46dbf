#pragma once

#include <string>

#include "sensing/core/result.h"

namespace taclink::command {

/// Empty path: nothing. Errors: kUnavailable.
Result<void> WriteText(const std::string& path, const std::string& text);

/// Between the marks "<!-- begin: COMMAND -->" and "<!-- end -->" of a page, if there are any; else the file
/// holds the text alone.
Result<void> WriteBetweenMarks(const std::string& path, const std::string& command, const std::string& text);

}  // namespace taclink::command
