#include "sensing/force/force_estimator.h"

#include "sensing/force/compliance_estimator.h"
#include "sensing/force/nonlinear_estimator.h"

namespace taclink {

std::unique_ptr<ForceEstimator> MakeForceEstimator(const LinkModel& model, const ForceOptions& options) {
  const ForceModel force_model = options.model.value_or(ForceModel::kLinear);
  if (force_model == ForceModel::kNonlinear) return std::make_unique<NonlinearEstimator>(model, options);
  return std::make_unique<ComplianceEstimator>(model, force_model, options);
}

}  // namespace taclink
