#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace taclink {

/// Of an even number the upper of the two in the middle; 0 of none. Changes the order of the values.
inline double Median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace taclink
