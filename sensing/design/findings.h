#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink {

enum class Severity : uint8_t {
  kNote,     ///< good to know
  kWarning,  ///< the link works, but some of it badly
  kFault,    ///< the link does not do its work
};
const char* Name(Severity severity);

/// Something about a design that its maker should know.
struct Finding {
  Severity severity = Severity::kNote;
  std::string id = {};    ///< stable, such as "marker_too_small"
  std::string what = {};  ///< in words, with the numbers
  /// Where it is worst; counted from 1.
  std::optional<int> path = {}, ring = {};
  std::optional<double> z_mm = {};
  int markers = 0;  ///< how many are concerned; 0: it is not about markers
  /// What was found, and the limit that it is held against.
  std::optional<double> value = {}, limit = {};
  std::string unit = {};    ///< of both
  std::string change = {};  ///< what to change; empty: nothing
};

/// A finding about markers, placed at one of them.
Finding AtMarker(const LinkModel& model, int marker, Finding finding);

/// The findings of each concern; see SkinDesign (skin_check.h).
struct SkinDesign;
std::vector<Finding> GeometryFindings(const SkinDesign& design);
std::vector<Finding> CameraFindings(const SkinDesign& design);
std::vector<Finding> SightFindings(const SkinDesign& design);
std::vector<Finding> MechanicsFindings(const SkinDesign& design);

}  // namespace taclink
