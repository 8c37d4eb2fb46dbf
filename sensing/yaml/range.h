#pragma once

#include <limits>

namespace taclink {

/// Bounds of a number, inclusive.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{.min = std::numeric_limits<double>::min()};
inline constexpr Range kNotNegative{.min = 0};

}  // namespace taclink
