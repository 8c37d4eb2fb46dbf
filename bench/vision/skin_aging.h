#pragma once

#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// What silicone does that is neither load nor pressure.
struct SkinAging {
  double set_share = 0;  ///< of the deepest dent so far that each marker stays displaced by: creep
  double warmer_k = 0;   ///< at the end of the scene; rises evenly
  bool any() const { return set_share != 0 || warmer_k != 0; }
};

/// Moves the markers of a simulated skin as aging does. Frames must follow each other.
class AgingSkin {
 public:
  /// `model` must outlive this; `duration_s` of the scene.
  AgingSkin(const LinkModel& model, const SkinAging& aging, double duration_s);

  void Move(SkinTruth& truth);

 private:
  const LinkModel& model_;
  const SkinAging aging_;
  const double duration_s_;
  std::vector<Vec3> untouched_mm_;  // as it was last
  std::vector<Vec3> set_mm_;
};

}  // namespace taclink
