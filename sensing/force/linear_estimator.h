#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"
#include "sensing/force/force_estimator.h"

namespace taclink {

struct LinearEstimatorOptions {
  /// A load is believed if it explains the displacements by this many standard deviations.
  double significance = 4.5;
  /// What the linear model itself gets wrong, as a fraction of each marker's displacement; adds to its noise.
  double model_error = 0.05;
  /// The same of the displacement that the pressure makes.
  double pressure_error = 0.03;
  /// Smallest standard deviation given to a marker, mm; detections correlate, so covariances alone are too
  /// proud.
  double noise_floor_mm = 0.03;
  int max_loads = 48;
  /// Elements per interval of the marker grid.
  int refinement = 2;
};

/// Contact forces from marker displacements with the linear shell.
///
/// Forces found as K u amplify camera noise (axial stiffness is 15 times the radial one, (6.4)). Here they
/// minimise
///   1/2 |W (u - G f)|^2 + s sum_j |W g_j| f_j    over f >= 0,
/// G the compliance from loads pushing inwards at the markers' nodes to the markers (rotations free, moments
/// zero), W the markers' weights, s the significance: a load stays out unless it explains s standard
/// deviations, so noise makes no forces. Solved by Lawson and Hanson's active set; the loads found are then
/// fitted once more without the second term, which would make them too small. Holds scratch memory: one
/// thread.
class LinearForceEstimator final : public ForceEstimator {
 public:
  explicit LinearForceEstimator(const LinkModel& model, const LinearEstimatorOptions& options = {});

  /// Uses the shape's measured displacements; its others are not independent of each other. `pressure_mpa`:
  /// gauge pressure now less that of the baseline.
  void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) override;

 private:
  bool Whiten(const SkinShape& shape, double pressure_mpa);
  void WhitenCompliance();
  int MostSignificantLoad() const;
  void FindLoads(NodalForces& forces);
  bool StepToOptimum();
  void RemoveBias();
  void FactorGram();
  void FitLoaded(double penalty, Eigen::VectorXd& load);
  void UpdateResidual();

  // Constant after construction.
  LinearEstimatorOptions options_;
  int markers_;
  std::vector<Vec3> inward_;      // unit, by marker
  Eigen::MatrixXd compliance_;    // 3 markers x loads, mm/N
  Eigen::VectorXd per_pressure_;  // 3 markers, mm/MPa

  // Scratch of one call.
  Eigen::MatrixXd whitener_;         // 3 x 3 blocks side by side: Cholesky factors of the information
  Eigen::MatrixXd whitened_;         // compliance in standard deviations
  Eigen::VectorXd norms_;            // of its columns
  Eigen::VectorXd data_, residual_;  // displacements in standard deviations
  Eigen::VectorXd correlation_;
  std::vector<int> loaded_;
  std::vector<char> is_loaded_;
  Eigen::VectorXd load_, trial_, rhs_;  // N, in the order of loaded_
  Eigen::MatrixXd gram_, columns_;      // gram_: lower half, becomes its own Cholesky factor
  int measured_numbers_ = 0;
};

}  // namespace taclink
