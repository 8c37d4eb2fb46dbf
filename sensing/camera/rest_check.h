#pragma once

#include <optional>
#include <string>

#include "sensing/camera/calibration.h"
#include "sensing/core/markers.h"

namespace taclink {

/// A patch of the skin that is not where the rest shape has it.
struct Dent {
  int marker = 0;       ///< in its middle
  int markers = 0;      ///< of the patch
  double depth_mm = 0;  ///< inwards; negative: a bulge
};

/// Looks for a patch whose markers lie further in (or out) than `limit_mm`, and stand out from the rest of
/// the skin. Noise and a mould's errors differ from marker to marker; a touch moves neighbours alike. Markers
/// left out of the fit count as well, by their residuals.
std::optional<Dent> FindDent(const RestShape& shape, const CalibrationSummary& summary, double limit_mm);

/// Residuals and their RMS where the cameras were known before these images; no more of the summary is set.
CalibrationSummary ResidualsOf(const RestShape& shape, const StereoRig& rig, const LabelledMarkers& rest);

/// What a person should know and do.
std::string Describe(const LinkModel& model, const Dent& dent);

}  // namespace taclink
