#pragma once

#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// What one body does to a skin of three-dimensional solids.
struct SolidContact {
  std::string kind;
  bool glued = false;
  Vec3 force_n = Vec3::Zero();
  double normal_force_n = 0;
  Vec3 center_mm = Vec3::Zero();
  Vec2 extent_mm = Vec2::Zero();  ///< half widths around and along
};

/// A scene that another program solved (tests/accuracy/calculix, docs/reports/calculix.md).
struct SolidScene {
  std::string name, family;
  bool held_out = false;  ///< no constant may be chosen by it
  double pressure_kpa = 0, baseline_kpa = 0;
  /// Gravity less the link's acceleration, link frame; zero: the solids had no weight.
  Vec3 specific_force_mps2 = Vec3::Zero(), baseline_specific_force_mps2 = Vec3::Zero();
  std::vector<SolidContact> contacts;
  std::vector<Vec3> markers_mm;   ///< displacements from the slack skin
  std::vector<Vec3> baseline_mm;  ///< likewise, of the skin under the baseline's known loads

  /// Loads that surround the skin, or are larger than the distances between them: judged by their sum.
  bool IsDistributed() const;
};

/// Empty: the table is not there.
std::vector<SolidScene> ReadSolidScenes();

/// Solids with weight: each of them from the baseline of each that nothing touches, in another attitude.
std::vector<SolidScene> ReadWeightScenes();

/// The solids' skin.
LinkModel SolidSkin();

}  // namespace taclink
