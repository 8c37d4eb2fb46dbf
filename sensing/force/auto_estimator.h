#pragma once

#include <memory>
#include <vector>

#include "sensing/force/force_estimator.h"
#include "sensing/mechanics/pressed_skin.h"

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
  // What the cheaper models get wrong at one pressure, by how far the pushed marker moved; ascending.
  struct Learned {
    double pressure_mpa = 0;
    std::vector<double> depths_mm, linear_errors, pressurised_errors;
  };
  Learned Learn(PressedSkin& skin, double pressure_mpa);
  ForceModel Choose(const SkinShape& shape, double pressure_mpa) const;

  LinkModel model_;
  ForceOptions options_;
  std::unique_ptr<ForceEstimator> linear_, pressurised_, nonlinear_;
  ForceModel last_ = ForceModel::kLinear;
  std::vector<Learned> learned_;       // ascending pressures
  Eigen::VectorXd inflation_per_mpa_;  // of the markers, stacked
};

}  // namespace taclink
