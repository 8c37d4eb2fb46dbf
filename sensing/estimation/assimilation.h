#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/sparse_cholesky.h"

namespace taclink {

/// What cameras say of the markers: displacement from the slack skin, and its information (inverse
/// covariance, 1/mm^2; rank 2 where one camera saw it, 0: not seen). By marker index, link frame.
struct MarkerObservations {
  std::vector<Vec3> displacement_mm;
  std::vector<Mat3> information;
};

struct AssimilationSummary {
  int iterations = 0;
  bool converged = false;
};

/// The shell's shape when springs pull its markers to where they are seen:
///   min  Pi(u, q) + 1/2 sum_m (m(u) - d)' W_m (m(u) - d),
/// Newton with a line search, where the Hessian is indefinite with a shift. Springs and not loads: nothing
/// has to be known of where something touches, and no start from an earlier frame is needed; it leads there
/// in less steps. The springs stretch by force / stiffness, so that the shape is a good place to linearize
/// at, not an answer. One thread.
class Assimilation {
 public:
  explicit Assimilation(const SkinMechanics& mechanics);

  /// From `state`, under known loads. Sets `pulls_n`: the springs' forces on the markers, stacked.
  AssimilationSummary Run(const MarkerObservations& observed, const KnownLoads& known, ShellState& state,
                          Eigen::VectorXd& pulls_n);

 private:
  double Value(const ShellState& state, const NonlinearShell::Loads& loads);
  bool FindStep(const ShellState& state, const NonlinearShell::Loads& loads);
  void SetSprings(const MarkerObservations& observed);

  const SkinMechanics& mechanics_;
  Eigen::SparseMatrix<double> hessian_;
  std::vector<int> diagonal_;  // slots
  Eigen::VectorXd rest_diagonal_;
  SparseCholesky factor_;
  MarkerMap::Jacobian jacobian_;
  const MarkerObservations* observed_ = nullptr;
  std::vector<Mat3> springs_;
  Eigen::VectorXd markers_mm_, gradient_, step_;
  ShellState trial_;
};

}  // namespace taclink
