#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink {

enum class Severity : uint8_t {
  kNote,     ///< information
  kWarning,  ///< the link works, but with reduced performance
  kFault,    ///< the link does not work as intended
};
const char* Name(Severity severity);

/// One result of the check of a design.
struct Finding {
  Severity severity = Severity::kNote;
  std::string id = {};    ///< stable, such as "marker_too_small"
  std::string what = {};  ///< description, with the numbers
  /// The worst place; path and ring from 1.
  std::optional<int> path = {}, ring = {};
  std::optional<double> z_mm = {};
  int markers = 0;  ///< number of markers concerned; 0: not about markers
  /// The computed value and its limit.
  std::optional<double> value = {}, limit = {};
  std::string unit = {};    ///< of both
  std::string change = {};  ///< what to change; empty: nothing
};

/// Sets the place of a finding to that of a marker.
Finding AtMarker(const LinkModel& model, int marker, Finding finding);

/// Findings by subject; see SkinDesign (skin_check.h).
struct SkinDesign;
std::vector<Finding> GeometryFindings(const SkinDesign& design);
std::vector<Finding> CameraFindings(const SkinDesign& design);
std::vector<Finding> SightFindings(const SkinDesign& design);
std::vector<Finding> MechanicsFindings(const SkinDesign& design);

}  // namespace taclink
