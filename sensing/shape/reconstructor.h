#pragma once

#include <optional>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/skin_shape.h"
#include "sensing/shape/calibration_doubt.h"
#include "sensing/shape/camera_evidence.h"
#include "sensing/shape/shape_estimator.h"

namespace taclink {

struct ShapeOptions {
  CameraEvidenceOptions cameras;
  ShapeEstimatorOptions estimator;
  /// As CalibrationSummary::covariance; empty: the cameras are taken as known.
  Eigen::MatrixXd calibration_covariance = {};
};

/// Labelled markers to 3-D positions of all markers, each with covariance and source: the most probable shape
/// of a skin that obeys the linear shell under few loads, see map_shape.md. Markers that one camera or none
/// sees follow from the others by the same mechanics. Observations that contradict all others are left out
/// and listed. Constant after construction but for the baseline, the frame before and scratch memory: one
/// thread. Steady state allocates nothing.
class ShapeReconstructor {
 public:
  /// Solves the shell, about 0.2 s at 256 markers.
  ShapeReconstructor(const LinkModel& model, const StereoRig& rig, const ShapeOptions& options = {});

  /// Takes the markers of the untouched skin (means over frames, with the means' covariances), under a gauge
  /// pressure. Before the first call they are expected where the model's projection has them.
  void SetBaseline(const LabelledMarkers& rest, double pressure_mpa = 0);
  /// Takes what is seen now as the untouched skin; markers that `now` does not show keep their baseline.
  void Tare(const LabelledMarkers& now, double pressure_mpa);
  /// How a change of the gauge pressure displaces a marker; link frame, mm.
  Vec3 PressureDisplacement(int marker, double change_mpa) const;

  /// `pressure_mpa`: gauge pressure; none: not known, and estimated.
  void Reconstruct(const LabelledMarkers& markers, std::optional<double> pressure_mpa, SkinShape& shape);

  int rounds() const { return estimator_.rounds(); }
  /// Loads that the last shape needs, N; inward, around, and across both, by 3 * marker + direction.
  const ShapeSolver& solver() const { return estimator_.solver(); }
  const SkinBasis& basis() const { return estimator_.basis(); }

 private:
  void SetBaseline(const LabelledMarkers& rest, double pressure_mpa, bool keep_unseen);
  void Write(SkinShape& shape) const;

  const std::vector<Vec3> model_rest_mm_;
  ShapeEstimator estimator_;
  CameraEvidence evidence_;
  const CalibrationDoubt doubt_;
  Eigen::VectorXd rest_u_;  // of the skin in the rest pictures, own frames
};

}  // namespace taclink
