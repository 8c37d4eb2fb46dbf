#pragma once

#include <string>
#include <vector>

#include "bench/force/accuracy_scenes.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// What a body really does to the skin.
struct BodyContact {
  Vec3 force_n = Vec3::Zero();    ///< on the skin
  Vec3 center_mm = Vec3::Zero();  ///< of pressure, on the outer surface
  std::vector<Vec3> touched_mm;   ///< nodes of the outer surface that touch; may be none

  /// From the nearest touched point or the centre.
  double DistanceTo(const Vec3& point_mm) const;
};

struct TrueStage {
  PressStage stage;
  std::vector<Vec3> displacements_mm;  ///< of the markers' centres, from the undeformed skin
  std::vector<BodyContact> contacts;   ///< by body; one that does not touch has no force
  std::vector<Vec3> baseline_mm;       ///< displacements of the baseline, likewise; empty: it is undeformed
};

/// A path as the forward solver has it, up to where it failed.
struct PathTruth {
  PressPath path;
  TrueStage inflated;  ///< before the bodies come, with its weight
  std::vector<TrueStage> stages;
  std::string failure;  ///< why stages are missing; empty: none are
  double cpu_s = 0;     ///< it took
};

PathTruth SolvePath(const LinkModel& model, const PressPath& path, int refinement);

/// The same from `folder`, where it is kept once solved; an entry made for another model, path or refinement
/// is solved anew. Delete the folder when the solver has changed. Empty `folder`: solve. Errors: kUnavailable
/// (it cannot be written).
Result<PathTruth> CachedPath(const LinkModel& model, const PressPath& path, int refinement,
                             const std::string& folder);

/// What a kept truth belongs to, in one line.
std::string TruthKey(const LinkModel& model, const PressPath& path, int refinement);
std::string TruthText(const PathTruth& truth, const std::string& key);
/// False: not a truth of this key. `path` is left alone.
bool ReadTruth(const std::string& text, const std::string& key, PathTruth& truth);

}  // namespace taclink
