#include "sensing/force/force_estimator.h"

#include "sensing/force/linear_estimator.h"

namespace taclink {

std::unique_ptr<ForceEstimator> MakeForceEstimator(const LinkModel& model, const ForceOptions& options) {
  LinearEstimatorOptions linear;
  linear.significance = options.significance;
  linear.noise_floor_mm = options.noise_floor_mm;
  if (options.refinement > 0) linear.refinement = options.refinement;
  return std::make_unique<LinearForceEstimator>(model, linear);
}

}  // namespace taclink
