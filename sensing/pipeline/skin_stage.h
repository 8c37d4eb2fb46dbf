#pragma once

#include <optional>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/markers.h"
#include "sensing/estimation/calibration_doubt.h"
#include "sensing/estimation/camera_evidence.h"
#include "sensing/pipeline/rest_comparison.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {

/// Labeled markers of one link to what a state tells of its skin: the cameras' rays are made displacements,
/// the estimator explains them, and what contradicts its answer is looked at again until both agree. Made
/// when the cameras are known. One thread.
class SkinStage {
 public:
  /// `noise_px`: of markers in rest pictures, each axis; 0: as detections tell.
  SkinStage(const LinkModel& model, const CalibrationSummary& calibration,
            const CameraEvidenceOptions& options, double noise_px = 0);

  /// Takes the markers of the untouched skin (means over frames, with the means' covariances), under known
  /// loads. `untouched_mm`: displacements by these loads, stacked; `residual_mm`: further displacements by
  /// dents of former contacts, which are not part of the baseline; empty: none.
  void SetBaseline(const LabelledMarkers& rest, const MeasuredLoads& loads,
                   const Eigen::VectorXd& untouched_mm, const Eigen::VectorXd& residual_mm = {});
  /// Takes what is seen now as the untouched skin; markers that `now` does not show keep their baseline.
  void Tare(const LabelledMarkers& now, const MeasuredLoads& loads, const Eigen::VectorXd& untouched_mm,
            const Eigen::VectorXd& residual_mm = {});
  /// In the frame that was run last.
  CameraAgreement agreement() const { return evidence_.Agreement(); }
  /// Likewise, where there was an answer: the camera that alone shows the skin elsewhere than pressure moves
  /// it.
  const std::optional<CameraId>& sees_alone() const { return sees_alone_; }
  /// Likewise, of the markers in both images from the estimated equilibrium, as cameras that have not moved
  /// see it. Empty: there was no answer.
  const ImageResiduals& residuals() const { return residuals_; }
  const MeasuredLoads& baseline_loads() const { return baseline_loads_; }

  /// `drift_mm`: how far the untouched skin has gone since the baseline, by marker; empty: not. `pressure`:
  /// none: nobody tells it, and the shape does. Sets shape, forces and contacts; `told` is the pressure that
  /// was taken as told.
  void Run(const LabelledMarkers& markers, const std::optional<MeasuredLoads>& pressure,
           std::span<const Vec3> drift_mm, StateEstimator& estimator, ContactFinder& finder, LinkState& state,
           MeasuredLoads& told);

 private:
  void CompareWithRest(const LabelledMarkers& markers, std::span<const Vec3> drift_mm,
                       const SkinEstimate& estimate);
  void TakeBaseline(const LabelledMarkers& markers, const MeasuredLoads& loads,
                    const Eigen::VectorXd& untouched_mm, const Eigen::VectorXd& residual_mm,
                    bool keep_unseen);
  void FindResiduals(std::span<const Vec3> drift_mm, const SkinEstimate& estimate);
  void Measure(const Eigen::VectorXd& about_mm, std::span<const Vec3> drift_mm, SkinShape& shape);

  const LinkModel model_;
  const double length_unit_;
  CameraEvidence evidence_;
  RestComparison rest_;
  std::optional<CameraId> sees_alone_;
  RestComparison::Expected expected_mm_;
  ImageResiduals residuals_;
  const CalibrationDoubt doubt_;
  MeasuredLoads baseline_loads_;
  Eigen::VectorXd baseline_mm_, about_mm_, now_mm_;
  MarkerObservations observed_;
  std::vector<Mat3> model_covariances_;
};

}  // namespace taclink
