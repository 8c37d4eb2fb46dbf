#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/markers/detect/detector.h"

namespace taclink {

/// Looks for the cause where a link's images fit neither its calibration nor each other (DiagnoseImages). It
/// takes as long as some frames, and is done twice a second while that lasts. One thread.
class CameraDiagnosis {
 public:
  explicit CameraDiagnosis(const LinkModel& model) : model_(model) {}

  /// The cameras were calibrated, or the link begins again.
  void Restart();

  /// After a frame was judged. `images`: CV_8UC1; empty: none from that camera. `skin_mm`: where the
  /// untouched skin has its markers, link frame, by marker.
  void Observe(const LinkState& state, const std::array<cv::Mat, kCameraCount>& images, const StereoRig& rig,
               std::span<const Vec3> skin_mm);

  /// Of the frame before. None: nothing is wrong, or it is something else.
  const std::optional<Reason>& reason() const { return reason_; }

 private:
  const LinkModel model_;
  MarkerDetector detector_;
  std::array<Detections, kCameraCount> spots_;
  std::optional<Reason> reason_;
  int suspect_frames_ = 0;  // in a row
  int64_t next_ns_ = 0;     // exposure; 0: at once
};

}  // namespace taclink
