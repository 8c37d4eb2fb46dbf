#pragma once

#include <span>
#include <string>

namespace taclink {

/// Markers for people, as "path 3, rings 4 to 6; path 7, ring 1", paths and rings counted from 1. At most
/// eight paths are listed, then how many more markers there are. `markers`: indices (see LinkModel) on
/// `paths` paths, in any order. Empty: no markers.
std::string MarkerText(std::span<const int> markers, int paths);

}  // namespace taclink
