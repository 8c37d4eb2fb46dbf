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
#include "sensing/estimation/camera_evidence.h"
#include "sensing/estimation/skin_estimator.h"
#include "sensing/markers/detect/detector.h"
#include "sensing/pipeline/camera_drift.h"
#include "sensing/pipeline/view_obstruction.h"

namespace taclink {

/// Looks for what is wrong with a link's cameras: in every frame whether their images grow (CameraDrift), and
/// where the images fit neither their calibration nor each other, how they are displaced (DiagnoseImages),
/// which takes as long as some frames and is done twice a second while that lasts. One thread.
class CameraDiagnosis {
 public:
  explicit CameraDiagnosis(const LinkModel& model) : model_(model) {}

  /// The rest images were taken: their known loads, under which the skin is stable, cameras and labels.
  /// `moved`: motion that the rest images show (RestResult::moved_cameras).
  void Begin(SkinMechanics& mechanics, const MeasuredLoads& loads, const StereoRig& rig,
             const LabelledMarkers& rest, const std::optional<Reason>& moved);

  /// What one frame shows.
  struct Frame {
    const std::array<cv::Mat, kCameraCount>& images;  ///< CV_8UC1; empty: none from that camera
    std::span<const Vec3> skin_mm;                    ///< the untouched skin's markers, link frame
    const SkinEstimate& estimate;
    const ImageResiduals& residuals;  ///< SkinStage::residuals
    const std::optional<ViewObstruction>& obstruction;
  };
  /// After a frame was judged.
  void Observe(const LinkState& state, const Frame& frame);

  /// Of the frame before. None: nothing is wrong, or it is something else.
  const std::optional<Reason>& reason() const { return reason_ ? reason_ : moved_ ? moved_ : growth_; }

 private:
  void ObserveGrowth(const Frame& frame, int64_t now_ns);

  const LinkModel model_;
  StereoRig rig_;
  std::optional<CameraDrift> drift_;  // none before Begin
  std::optional<Reason> moved_;       // since the calibration; kept until the next rest images
  std::optional<Reason> growth_;
  int grown_frames_ = 0;        // in a row
  int64_t grown_until_ns_ = 0;  // exposure; without another measurement the reason ends then
  MarkerDetector detector_;
  std::array<Detections, kCameraCount> spots_;
  std::optional<Reason> reason_;
  int suspect_frames_ = 0;  // in a row
  int64_t next_ns_ = 0;     // exposure; 0: at once
};

}  // namespace taclink
