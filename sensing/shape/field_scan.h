#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/shape/skin_basis.h"

namespace taclink {

/// Correlates a vector with all fields of a basis at once, C^T v. The loads' C is block circulant round the
/// axis, so it is a small real matrix for each harmonic: 60 k multiplications at 24 x 10, against 520 k;
/// bells are products of two factors. Holds scratch memory: one thread.
class FieldScan {
 public:
  explicit FieldScan(const SkinBasis& basis);

  /// By field.
  void Correlate(const Eigen::VectorXd& v, Eigen::VectorXd& correlations);

 private:
  void CorrelateLoads(const Eigen::VectorXd& v, Eigen::VectorXd& correlations);
  void CorrelateBells(const Eigen::VectorXd& v, Eigen::VectorXd& correlations);

  const SkinBasis& basis_;
  int paths_, rings_;
  std::vector<Eigen::MatrixXd> kernels_;  // by harmonic: 3 rings x load columns
  Eigen::MatrixXd waves_;                 // paths x 2 harmonics: cos, sin
  Eigen::MatrixXd half_on_;               // the same half a path on
  std::vector<Eigen::MatrixXd> around_;   // by width and ring: paths x paths
  Eigen::MatrixXd along_;                 // 3 x paths
  Eigen::MatrixXd amplitudes_, answers_;  // 2 harmonics x 3 rings, x load columns
};

}  // namespace taclink
