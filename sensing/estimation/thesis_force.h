#pragma once

#include <memory>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// The force of [duong2021]: F = K u with zero rotations, (6.1) and (6.2), of which only the radial part
/// counts, (6.5) and (6.6), where it pushes in by more than 0.02 N per mm of the cameras' error. For
/// comparison only: it amplifies the markers' noise, and the rotations are not zero.
class ThesisForce {
 public:
  explicit ThesisForce(const LinkModel& model, int refinement = 1);
  ~ThesisForce();

  /// `displacements_mm`: of all markers from the baseline, stacked; `pressure_mpa`: gauge pressure less that
  /// of the baseline.
  void Estimate(const Eigen::VectorXd& displacements_mm, double pressure_mpa, NodalForces& forces);

 private:
  struct Solver;
  std::unique_ptr<Solver> solver_;
};

}  // namespace taclink
