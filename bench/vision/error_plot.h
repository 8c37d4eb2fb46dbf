#pragma once

#include <string>
#include <vector>

namespace taclink {

struct PlotPoint {
  double x = 0, y = 0;  ///< positive
  size_t series = 0;    ///< its colour
  std::string label;
};

/// Points over two logarithmic axes. SVG.
std::string LogPlot(const std::vector<PlotPoint>& points, const std::string& x_label,
                    const std::string& y_label);

}  // namespace taclink
