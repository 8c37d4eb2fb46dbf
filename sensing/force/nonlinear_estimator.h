#pragma once

#include <memory>

#include "sensing/force/force_estimator.h"
#include "sensing/force/pressurised_tangents.h"

namespace taclink {

/// Forces from displacements of any size: the nonlinear shell is kept in equilibrium with the loads of the
/// frame before, and Gauss-Newton steps about that state (LoadFit with exact columns) make it the shape that
/// the markers show. The tangent stays factorised from frame to frame for as long as it brings the shell back
/// to equilibrium.
class NonlinearEstimator final : public ForceEstimator {
 public:
  /// `tangents`: to share with others of the same link and refinement; none: its own.
  NonlinearEstimator(const LinkModel& model, const ForceOptions& options,
                     std::shared_ptr<PressurisedTangents> tangents = {});
  ~NonlinearEstimator() override;

  void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) override;
  void Restart() override;

  /// What it took so far, for benchmarks.
  struct Work {
    long frames = 0, iterations = 0, factorisations = 0;
  };
  const Work& work() const;

 private:
  struct Solver;
  std::unique_ptr<Solver> solver_;
  std::unique_ptr<ForceEstimator> fallback_;  // where no equilibrium is found; tells so
};

}  // namespace taclink
