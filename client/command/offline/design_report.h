#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sensing/design/skin_check.h"

namespace taclink::command {

/// Findings and a table of the rings, on standard output.
void PrintDesign(const SkinDesign& design, const std::vector<Finding>& findings);

/// One JSON object: model, options, findings, limits of pressure, weight, and for each state (slack, loaded)
/// the rings and the markers.
std::string DesignJson(const SkinDesign& design, const std::vector<Finding>& findings);

/// Maps over path and ring, as SVG: file name without a folder, and text. Of the loaded state where there is
/// one, and of the slack one.
std::vector<std::pair<std::string, std::string>> DesignMaps(const SkinDesign& design);

/// The same in one page, with the findings.
std::string DesignHtml(const SkinDesign& design, const std::vector<Finding>& findings);

}  // namespace taclink::command
