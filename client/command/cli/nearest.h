#pragma once

#include <string>
#include <vector>

namespace taclink::command {

/// The name that `typed` is most likely a misspelling of: the one with the fewest letters inserted, left out,
/// replaced or swapped with their neighbor, at most a third of them. Empty: none is near.
std::string Nearest(const std::string& typed, const std::vector<std::string>& names);

}  // namespace taclink::command
