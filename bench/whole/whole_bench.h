#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/force/force_method.h"
#include "bench/whole/whole_scenes.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"

namespace taclink {

/// What a frame's answer is worth against the truth.
struct WholeFrame {
  double time_s = 0;
  LinkStatus status = LinkStatus::kStarting;
  std::vector<ReasonId> reasons;
  bool has_forces = false;
  bool is_right = false;       ///< forces within 10 % or 0.03 N, centers within 4 mm, nothing invented
  bool is_silent = false;      ///< wrong by 0.03 N, 15 % and 3 sigma at once, while the status is `ok`
  double worst_marker_mm = 0;  ///< of the displacements; 0: nothing is measured
  int bodies = 0, within_2_sigma = 0;
  /// What presses, and by how much the answers are off: sums over the bodies, and over what is not there.
  double true_n = 0, off_n = 0;
  /// Of the bodies, those that press more than the frame's limit of detection where they are, and how many of
  /// them were found.
  int above_limit = 0, found_above_limit = 0;
  double cpu_ms = 0;
  std::string how;            ///< what is wrong, for people
  std::string status_reason;  ///< as the link gives it
};

/// What became of one scene.
struct WholeOutcome {
  const WholeScene* scene = nullptr;
  ForceMethod method;
  std::vector<WholeFrame> frames;  ///< all
  std::string refusal;             ///< the last status reason before anything was measured
  std::string failure;             ///< why the skin itself could not be simulated; then there are no frames
};

struct WholeOptions {
  std::vector<ForceMethod> methods = {ForceMethod{}};
  int jobs = 1;  ///< skins at the same time
  std::function<void(const WholeOutcome&)> done =
      {};  ///< called from the workers, one at a time; may be empty
};

/// Shows the scenes' pictures to links with default settings but for the force method, skin by skin.
/// `models`: those that scenes name. Outcomes scene by scene, of each all methods.
std::vector<WholeOutcome> RunWholeBench(const std::vector<LinkModel>& models,
                                        const std::vector<WholeScene>& scenes, const WholeOptions& options);

}  // namespace taclink
