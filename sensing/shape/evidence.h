#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <span>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

/// What a frame says about one marker's displacement, in the marker's own frame (see SkinBasis).
struct MarkerEvidence {
  Mat3 information = Mat3::Zero();  ///< of the displacement, 1/mm^2; rank 2: one camera, 0: none
  Vec3 pull = Vec3::Zero();         ///< information * (measured - estimate)
  double chi2 = 0;                  ///< of the residuals, slack allowed for
  int numbers = 0;                  ///< that were observed
};

/// A single observation and how badly it fits.
struct Misfit {
  int observation = -1;
  int marker = -1;
  double chi2 = 0;
};

/// A frame's observations, linearised about an estimate.
class Evidence {
 public:
  virtual ~Evidence() = default;

  /// Linearises about the displacements `u` (3 a marker). `slack`: variances of what the estimate can't
  /// follow, 3 a marker, mm^2; they add to those of the observations. Writes one entry a marker.
  virtual void Evaluate(const Eigen::VectorXd& u, const Eigen::VectorXd& slack,
                        std::vector<MarkerEvidence>& markers) = 0;
  /// The worst observation at the last Evaluate.
  virtual Misfit Worst() const = 0;
  /// Leaves an observation out from the next Evaluate on.
  virtual void Drop(int observation) = 0;
  /// Takes those back that fit displacements `u` known with `covariances` (by marker). True: there are some.
  virtual bool Readmit(const Eigen::VectorXd& u, std::span<const Mat3> covariances) = 0;
  virtual int dropped() const = 0;
};

/// Evidence with slack: observations of a displacement u + e, e ~ N(0, slack), instead of u.
inline MarkerEvidence WithSlack(const MarkerEvidence& exact, const Vec3& slack) {
  const Mat3 shrink = (Mat3::Identity() + exact.information * slack.asDiagonal()).inverse();
  const Mat3 information = shrink * exact.information;
  return {0.5 * (information + information.transpose()), shrink * exact.pull, exact.chi2, exact.numbers};
}

}  // namespace taclink
