#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// A shipped model's name, a file, or "all": the shipped ones.
Result<std::vector<LinkModel>> LoadBenchModels(const std::string& name);

/// Empty path: nothing. Errors: kUnavailable.
Result<void> WriteText(const std::string& path, const std::string& text);

/// Between the marks "<!-- begin: COMMAND -->" and "<!-- end -->" of a page, if there are any; else the file
/// holds the text alone.
Result<void> WriteBetweenMarks(const std::string& path, const std::string& command, const std::string& text);

}  // namespace taclink::command
