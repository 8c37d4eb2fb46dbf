#include "sensing/force/force_estimator.h"

#include "sensing/force/auto_estimator.h"
#include "sensing/force/compliance_estimator.h"
#include "sensing/force/literal_estimator.h"
#include "sensing/force/nonlinear_estimator.h"

namespace taclink {

std::unique_ptr<ForceEstimator> MakeForceEstimator(const LinkModel& model, const ForceOptions& options) {
  if (!options.model) return std::make_unique<AutoEstimator>(model, options);
  switch (*options.model) {
    case ForceModel::kLiteral:
      return std::make_unique<LiteralEstimator>(model, options);
    case ForceModel::kNonlinear:
      return std::make_unique<NonlinearEstimator>(model, options);
    case ForceModel::kLinear:
    case ForceModel::kPressurised:
      break;
  }
  return std::make_unique<ComplianceEstimator>(model, *options.model, options);
}

}  // namespace taclink
