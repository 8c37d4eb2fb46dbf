#pragma once

#include <memory>
#include <vector>

#include "sensing/force/force_estimator.h"

namespace taclink {

/// The cheapest model whose estimated error is below the tolerance, frame by frame. What `linear` and
/// `pressurised` get wrong is learned at construction from pushes on this very skin's nonlinear shell: by
/// how far the markers move, and by the pressure.
class AutoEstimator final : public ForceEstimator {
 public:
  AutoEstimator(const LinkModel& model, const ForceOptions& options);
  ~AutoEstimator() override;

  void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) override;
  void Restart() override;

  /// Estimated relative error of a model's forces where the markers move by `displacement_mm` beyond what the
  /// pressure does.
  double ErrorOf(ForceModel model, double pressure_mpa, double displacement_mm) const;

 private:
  ForceModel Choose(const SkinShape& shape, double pressure_mpa) const;

  ForceOptions options_;
  std::unique_ptr<ForceEstimator> linear_, pressurised_, nonlinear_;
  ForceModel last_ = ForceModel::kLinear;
  // Relative errors by depth, at pressures[i]; ascending.
  std::vector<double> pressures_mpa_, depths_mm_;
  std::vector<std::vector<double>> linear_errors_, pressurised_errors_;
  Eigen::VectorXd inflation_per_mpa_;  // of the markers, stacked
};

}  // namespace taclink
