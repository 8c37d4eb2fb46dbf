#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sensing/camera/bundle.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// The point of a marker whose projection is the centre of what `camera_mm` sees of it (link frame, mm). A
/// dome of half a ball looks like a half disc from the side, and like a disc about its foot from above: its
/// outline's centroid stands (1 - c) h off the foot, across the line of sight, where c is the cosine between
/// that and the wall's inward normal and h = 4 r / (3 pi) how much deeper than the wall the model's
/// center_depth_mm is. `domes` false: the model's centre, from everywhere.
Vec3 SeenPoint(const LinkModel& model, int marker, const Vec3& camera_mm, bool domes);

struct CameraFitOptions {
  BuildTolerance tolerance;
  LensKind lens = LensKind::kDivision;
  bool domes = true;
};

/// One camera against one rest picture, with the markers where the model has them.
struct CameraFit {
  CameraModel camera;
  std::vector<BundleSample> samples;  ///< inliers; the covariances are of the pictures alone
  std::vector<int> outliers;          ///< marker numbers
  /// How much larger the residuals are than the covariances and the mould's tolerance say; at least 1.
  double misfit = 1;
  BundleResult bundle;  ///< the last round's; its covariance counts the misfit
};

/// Starts from the closed form and from the nominal lens, takes the better end. None: no start converges.
/// Observations with a standard deviation beyond 2 px (clipped ones) are left out.
std::optional<CameraFit> FitCamera(const LinkModel& model, CameraId id,
                                   std::span<const MarkerObservation> rest, const CameraFitOptions& options);

/// How many of them FitCamera uses.
int CountUsable(std::span<const MarkerObservation> rest);

}  // namespace taclink
