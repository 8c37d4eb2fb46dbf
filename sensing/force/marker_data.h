#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

/// The markers' displacements, and how far they can be believed.
class MarkerData {
 public:
  MarkerData(int markers, double noise_floor_mm);

  /// What is left of the measured displacements after `predicted_mm` (stacked); `model_sigma_mm` by marker:
  /// what the prediction may be wrong by. Unseen markers, and numbers that are none, count nothing.
  void Set(const SkinShape& shape, const Eigen::VectorXd& predicted_mm,
           const Eigen::VectorXd& model_sigma_mm);

  /// information * column, marker by marker.
  void Weigh(const Eigen::Ref<const Eigen::VectorXd>& column, Eigen::Ref<Eigen::VectorXd> weighed) const;

  Eigen::VectorXd measured_mm, residual_mm;  ///< stacked; unseen markers: as predicted
  std::vector<Mat3> information_per_mm2;     ///< by marker
  int numbers = 0;                           ///< how many were measured

 private:
  double floor2_;
};

}  // namespace taclink
