#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sensing/force/force_estimator.h"
#include "sensing/force/load_fit.h"
#include "sensing/force/load_sites.h"
#include "sensing/force/pressurised_tangents.h"
#include "sensing/force/skin_tangent.h"

namespace taclink {

/// Forces from small displacements about one shape: the rest shape (`linear`) or that under the pressure
/// (`pressurised`). Loads that act at sites are fitted to the markers (LoadFit): multiplying displacements
/// with a stiffness would amplify camera noise, axial stiffness is 15 times the radial one (6.4).
class ComplianceEstimator final : public ForceEstimator {
 public:
  /// `model`: kLinear or kPressurised. `tangents`: to share with others of the same link and refinement;
  /// none: its own.
  ComplianceEstimator(const LinkModel& model, ForceModel force_model, const ForceOptions& options,
                      std::shared_ptr<PressurisedTangents> tangents = {});

  void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) override;
  void Restart() override { last_.clear(); }

 private:
  const SkinTangent* TangentAt(double pressure_mpa);
  void SetData(const SkinShape& shape, double pressure_mpa, const SkinTangent& tangent);
  void FindLoads(const SkinTangent& tangent, NodalForces& forces);

  // Constant after construction.
  ForceModel force_model_;
  LoadFitOptions fit_options_;
  double model_error_, pressure_error_;
  LoadSites sites_;
  SkinTangent linear_;

  std::shared_ptr<PressurisedTangents> pressurised_;
  MarkerData data_;
  LoadFit fit_;
  Eigen::VectorXd predicted_mm_, model_sigma_mm_, column_;
  struct Load {
    int site;
    double load_n;
  };
  std::vector<Load> last_;  // of the frame before
};

}  // namespace taclink
