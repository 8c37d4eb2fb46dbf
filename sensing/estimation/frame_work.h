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
  int Units() const { return evaluations / 2 + 20 * tangents + 5 * steps + trials / 2; }

  static constexpr int kUnlimited = std::numeric_limits<int>::max();
  /// What a frame of a live link may cost. Of 745 frames of solids without wrong markers no right answer took
  /// more than 460, except one of 1,282 (a squeeze by six bodies); images of two moments take 1,000 and more
  /// before they are given up, and the next frame is waiting.
  static constexpr int kLiveUnits = 500;
};

}  // namespace taclink
