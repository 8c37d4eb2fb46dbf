#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sensing/camera/bundle.h"
#include "sensing/camera/rest_shape.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// The point of a marker at rest whose projection is the centre of what `camera_mm` sees of it (link frame,
/// mm), see SeenOfDome. `domes` false: the model's centre, from everywhere.
Vec3 SeenPoint(const RestShape& rest, int marker, const Vec3& camera_mm, bool domes);

struct CameraFitOptions {
  BuildTolerance tolerance;
  LensKind lens = LensKind::kDivision;
  bool domes = true;
};

/// One camera against one rest image, with the markers where the rest shape has them.
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
std::optional<CameraFit> FitCamera(const RestShape& rest, CameraId id,
                                   std::span<const MarkerObservation> seen, const CameraFitOptions& options);

/// How many of them FitCamera uses.
int CountUsable(std::span<const MarkerObservation> rest);

}  // namespace taclink
