#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// What the errors of calibrated cameras make of displacements. The rest pictures are right whatever the
/// calibration says, so the error grows with the displacement; it is the same in every frame and alike in
/// neighbours. Linear in both: error = sum over k of T_mk u e_k, with independent e_k ~ N(0, 1). Constant.
class CalibrationDoubt {
 public:
  CalibrationDoubt() = default;  ///< none
  /// `covariance`: as CalibrationSummary::covariance; empty: none.
  CalibrationDoubt(const LinkModel& model, const StereoRig& rig, const Eigen::MatrixXd& covariance);

  /// Covariance of a marker's displacement `u_mm`, mm^2; link frame.
  Mat3 Of(size_t marker, const Vec3& u_mm) const;

 private:
  int directions_ = 0;
  std::vector<Mat3> per_mm_;  // T, by marker and then by direction
};

}  // namespace taclink
