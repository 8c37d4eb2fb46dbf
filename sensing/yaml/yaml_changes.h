#pragma once

#include <string>
#include <vector>

namespace taclink {

/// Keys whose values differ between two YAML documents, and no values: "limits.max_streams",
/// "arm.links.base.gain". An item of a list goes by its name, or its number from 1.
std::vector<std::string> ChangedKeys(const std::string& before, const std::string& after);

}  // namespace taclink
