#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"

namespace taclink {

/// What a method makes of one pair.
struct VisionResult {
  LabelledMarkers labels;  ///< in pixels of the full picture
  SkinShape shape;         ///< empty: nothing measured. Covariances may be missing
  LinkStatus status = LinkStatus::kStarting;
  std::string status_reason;
  StageTimes stage_ms;  ///< CPU time of the thread
};

/// A way from pictures to marker positions, to be measured beside others on the same frames. The first frames
/// show the untouched skin.
class VisionMethod {
 public:
  virtual ~VisionMethod() = default;
  /// `result`'s buffers are reused.
  virtual void Process(const StereoFrame& frame, VisionResult& result) = 0;
  /// Forgets everything it was shown: another link of the same model follows.
  virtual void Restart() = 0;
};

/// A method's name, one line about it, and how to make one for a link.
struct VisionMethodKind {
  std::string name;
  std::string description;
  std::function<std::unique_ptr<VisionMethod>(const LinkModel&)> make;
  bool by_default = true;  ///< false: only where it is asked for
};

/// All there are; the first is the product as it runs.
const std::vector<VisionMethodKind>& VisionMethodKinds();

}  // namespace taclink
