#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/command/logs/solve_log_report.h"
#include "client/command/logs/solve_log_settings.h"
#include "sensing/contact/contact_finder.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_state.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/state_estimator.h"
#include "taclink/v1/frame.pb.h"

namespace taclink::command {

/// A picture's message, and the name of its type.
struct RecordedPicture {
  std::string type;
  std::shared_ptr<const std::string> bytes;
};
using RecordedPictures = std::array<std::optional<RecordedPicture>, kCameraCount>;

/// Solves one link's frames of a log again, in their order. Not for two threads at a time.
class LogLinkSolver {
 public:
  /// `from_pictures`: the whole pipeline; false: forces and contacts of the recorded markers. The settings
  /// outlive it.
  LogLinkSolver(const LinkSettings& settings, bool from_pictures);

  /// The new LinkFrame's bytes. Frames without anything to solve come back as they are: reports of a link's
  /// status, frames whose pictures are not in the log. Errors: kInvalidArgument (a damaged message),
  /// kFailedPrecondition (neither pictures nor the markers of a full frame), kUnsupported (such pictures).
  Result<std::string> Solve(const std::string& recorded_bytes, const RecordedPictures& pictures);
  /// The newest frame as Foxglove draws it: bytes of a SceneUpdate.
  std::string Scene(int64_t utc_ns) const;

  const LinkReport& report() const { return report_; }

 private:
  void Begin();
  void NoteFrame();
  Result<void> SolvePictures(const RecordedPictures& pictures, v1::LinkFrame& solved);
  Result<RawImage> Image(CameraId camera, const std::optional<RecordedPicture>& picture) const;
  Result<void> SolveMarkers(v1::LinkFrame& solved);
  MeasuredLoads MeasuredInFrame() const;
  void FollowLoads();
  void SolveForces();
  bool IsPressureTold() const;
  double FramePressure() const;

  // Constant after construction.
  const LinkSettings& settings_;

  // Made with the first frame: takes a while.
  std::unique_ptr<LinkPipeline> pipeline_;
  std::unique_ptr<StateEstimator> estimator_;
  std::unique_ptr<ContactFinder> finder_;

  StereoFrame frame_;
  LinkState recorded_;  // the frame in work, as it is in the log
  LinkState state_;     // as it is solved
  bool solved_newest_ = false;
  int64_t first_utc_ns_ = 0;
  // While forces of recorded markers are solved.
  int64_t baseline_utc_ns_ = 0;
  LoadsPair loads_;
  std::optional<MeasuredLoads> before_;  // of the frame before
  LinkReport report_;
};

}  // namespace taclink::command
