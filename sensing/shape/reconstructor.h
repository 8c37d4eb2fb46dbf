#pragma once

#include <array>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/camera/triangulation.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

struct ShapeOptions {
  /// Error of the calibrated cameras themselves, px; added to each detection's.
  double camera_sigma_px = 0.1;
  /// A triangulated marker whose reprojection is off by more than this many sigmas is not believed; the
  /// second figure is the least sigma for this test, for calibrations that are not perfect.
  double max_residual_sigmas = 5;
  double min_gate_sigma_px = 0.5;
  /// Nor is one further outside the skin at rest than this, or inside the tube.
  double max_outward_mm = 15;
  /// Standard deviation of what is assumed for markers that only one camera sees (their z, (4.31)), and of
  /// those that none sees (each axis, (4.33)).
  double assumed_z_sigma_mm = 2.5;
  double inferred_sigma_mm = 5;
  /// Of the model's rest position, which stands in for that of a marker unseen in the baseline, each axis.
  double unseen_rest_sigma_mm = 2;
};

/// Labelled markers to 3-D positions, each with covariance and source.
///
/// Both cameras: weighted least squares of the reprojection, from where the rays meet, covariance
/// (J^T W J)^-1. One camera: the point of its ray at the z that the marker has at rest, (4.31) and (4.32).
/// None: displacement interpolated along the path between the nearest known markers or the clamped ends,
/// (4.33) and (4.34), which for straight paths is the same as interpolating positions. What is not plausible
/// counts as unseen.
///
/// Constant after construction but for the baseline and scratch memory: one thread. Steady state allocates
/// nothing.
class ShapeReconstructor {
 public:
  ShapeReconstructor(const LinkModel& model, const StereoRig& rig, ShapeOptions options = {});

  /// Displacements are from the baseline, their covariances include the baseline's.
  void Reconstruct(const LabelledMarkers& markers, SkinShape& shape);

  /// Takes a reconstructed shape as the baseline. Where no camera saw a marker, the model's rest
  /// position stands in, as it does for all markers before the first call.
  void SetBaseline(const SkinShape& rest);

 private:
  bool Triangulate(const MarkerObservation& top, const MarkerObservation& bottom, size_t marker,
                   SkinShape& shape) const;
  bool FromOneCamera(CameraId id, const MarkerObservation& seen, size_t marker, SkinShape& shape) const;
  bool Plausible(const Vec3& p, size_t marker) const;

  const LinkModel model_;
  const ShapeOptions options_;
  const std::vector<Projector> projectors_;  // by camera
  double length_mm_, tube_radius_mm_;
  std::vector<double> rest_radius_mm_;  // by marker, of the model
  std::vector<Vec3> model_rest_mm_, baseline_mm_;
  std::vector<Mat3> baseline_covariance_mm2_;
};

}  // namespace taclink
