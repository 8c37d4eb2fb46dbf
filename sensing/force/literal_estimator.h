#pragma once

#include <memory>

#include "sensing/force/force_estimator.h"

namespace taclink {

/// The thesis' own force: F = K u, (6.1) and (6.2), rotations zero, at the markers. For comparison only: it
/// amplifies the markers' noise, and the rotations are not zero. Unseen markers take what the shape infers.
class LiteralEstimator final : public ForceEstimator {
 public:
  LiteralEstimator(const LinkModel& model, const ForceOptions& options);
  ~LiteralEstimator() override;

  void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) override;

 private:
  struct Solver;
  std::unique_ptr<Solver> solver_;
};

}  // namespace taclink
