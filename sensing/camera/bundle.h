#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// How far a built link may be off its model, as standard deviations. One rest picture hardly tells a
/// camera's place on the axis, its focal length and its lens apart, nor a tilt and the principal point; where
/// the picture tells, these hardly count.
struct BuildTolerance {
  double place_mm = 2;      ///< of a camera, along each axis
  double tilt_rad = 0.035;  ///< of a camera about the picture's x and y
  double roll_rad = 0.09;   ///< of a camera about its optical axis
  double principal_point_px = 10;
  double lens = 0.03;      ///< of r(theta), as a part of it, over the angles that the link fills
  double marker_mm = 0.1;  ///< of a marker in the mould, along each axis
};

/// One marker in one picture.
struct BundleSample {
  int marker = 0;               ///< samples with the same number show the same marker
  Vec3 rest_mm = Vec3::Zero();  ///< where the model has what is seen of it, link frame
  Vec2 pixel = Vec2::Zero();
  Mat2 covariance_px2 = Mat2::Identity();
};

struct BundleCamera {
  CameraModel start;    ///< must see all samples
  CameraModel nominal;  ///< its lens may be of another kind
  std::vector<BundleSample> samples;
};

struct BundleOptions {
  BuildTolerance tolerance = {};
  bool move_markers = true;  ///< false: they are where the model has them
  /// Displacements that all markers have together, in shares of unit variance: stacked by marker number (3
  /// rows each), a column for each. Empty: none. With `move_markers` only.
  Eigen::MatrixXd modes_mm = {};
  double loss_width = 3;  ///< beyond so many sigmas a sample pulls less and less (Cauchy's loss)
  int max_steps = 100;
  bool with_covariance = true;
};

struct BundleResult {
  std::vector<CameraModel> cameras;  ///< in the order given
  /// Of the CameraSteps off `cameras`, one after the other: 13 rows each, those of unused parameters 0. Empty
  /// if not asked for, or if the parameters can't be told apart.
  Eigen::MatrixXd covariance;
  std::vector<Vec3> marker_shift_mm;  ///< by marker number; zero where none is seen
  Eigen::VectorXd mode_shares;        ///< by column of the modes
  Eigen::MatrixXd mode_covariance;    ///< of these; empty as `covariance`
  double cost = 0;                    ///< half the sum of the squared (and dulled) residuals over sigmas
  double tolerance_cost = 0;          ///< the part of it that says how far the cameras are off the model
  int steps = 0;
  bool converged = false;
};

/// Bundle adjustment [triggs2000] with Ceres [ceres]: all parameters of the cameras, and where the markers
/// are, against the pictures and what is known of the build. The model's places of the markers fix the frame.
/// A camera that can't project its samples gives a result that has not converged.
BundleResult AdjustBundle(std::span<const BundleCamera> cameras, const BundleOptions& options);

}  // namespace taclink
