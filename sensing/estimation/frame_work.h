#pragma once

#include <limits>

namespace taclink {

/// What a frame has cost so far. Counted and not timed, so that the same frames always get the same answers.
struct FrameWork {
  int evaluations = 0;  ///< of the skin's forces, by Assimilation
  int tangents = 0;     ///< made in the frame's way
  int steps = 0;
  int trials = 0;  ///< of answers to which contacts there are (LoadEstimate::trials)

  /// About how many residuals with a back-substitution, at the default mesh.
  int Units() const { return evaluations / 3 + 40 * tangents + 10 * steps + trials / 2; }

  static constexpr int kUnlimited = std::numeric_limits<int>::max();
  /// What a frame of a live link may cost. Of two thousand frames of known truth on the cylinder no right one
  /// took more than 760, and a deep press of the barrel from nowhere takes 890; pictures that are torn or
  /// shifted take 2,500 and more, and what comes next is waiting.
  static constexpr int kLiveUnits = 1000;
};

}  // namespace taclink
