#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink::command {

/// A number for each marker, by index; not finite: there is none, and the cell is hatched gray.
struct MarkerMapValues {
  std::string title, unit;
  std::vector<double> values;
};

/// Rings (z) to the right, paths up; a cell for each marker, colored from the least to the most value, with a
/// scale. SVG.
std::string MarkerMapSvg(const LinkModel& model, const MarkerMapValues& map);

}  // namespace taclink::command
