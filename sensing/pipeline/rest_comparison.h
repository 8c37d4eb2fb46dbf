#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/pipeline/marker_radii.h"

namespace taclink {

/// Whether one picture shows the skin as pressure alone moves it while the other shows it pressed: they are
/// of two moments then, or a camera has moved. Needs no frame before, as CameraMotion does. One thread.
class RestComparison {
 public:
  /// `noise_px`: see RadiusReader.
  RestComparison(const LinkModel& model, const StereoRig& rig, double noise_px);

  /// The markers of the untouched skin; what they do not show is not compared.
  void SetBaseline(const LabelledMarkers& rest) { reader_.Read(rest, baseline_); }
  /// Where a camera is expected to see the untouched skin, by marker, from the baseline.
  using Expected = std::array<std::vector<Vec3>, kCameraCount>;
  /// The camera that alone sees the skin elsewhere; none: both do, or neither.
  std::optional<CameraId> SeesAlone(const LabelledMarkers& now, const Expected& expected_mm);

 private:
  const double length_unit_;
  RadiusReader reader_;
  MarkerRadii baseline_, now_;
};

}  // namespace taclink
