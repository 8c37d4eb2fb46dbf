#pragma once

#include <string>
#include <vector>

namespace taclink::command {

/// A curve of a CurvePanel; points that are not finite break it.
struct PlotCurve {
  std::string name;  ///< in the legend; empty: not there
  std::string colour;
  std::vector<double> x, y;
};

/// Curves over the same axes; the y axis includes zero.
struct CurvePanel {
  std::string x_label, y_label;
  std::vector<PlotCurve> curves;
};

/// Panels beside each other with the legend of the first one, as SVG. A panel without a finite point says so.
std::string CurvePlot(const std::string& title, const std::vector<CurvePanel>& panels);

/// Colours of `count` curves in a row, from blue to red.
std::string RampColour(size_t index, size_t count);

}  // namespace taclink::command
