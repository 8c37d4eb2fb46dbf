#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/linearization.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// How wrong the model's markers may be beside the cameras' noise. A shell is no solid: both differ by some
/// percent of the local displacement, alike over a thickness or two; and by forces that the model does not
/// have, carried through its own compliance, which gives soft directions (of a hug, a buckled skin) less
/// weight. Fitted as if it were camera noise that becomes tangential forces of the size of the normal one.
/// One thread.
class MarkerCovariance {
 public:
  explicit MarkerCovariance(const SkinMechanics& mechanics);

  /// `local_n`: force in the neighborhood of each site. Sets `covariance_mm2` (lower half, stacked markers)
  /// and the stray forces' standard deviations by direction and site.
  void Write(const Linearization& skin, const InflatedSkin& inflated, const Eigen::VectorXd& local_n,
             Eigen::MatrixXd& covariance_mm2);
  const std::array<Eigen::VectorXd, 3>& stray_sigmas_n() const { return stray_n_; }

  /// Forces on sites, or on markers, smoothed over the neighborhood in which they count as local.
  Eigen::VectorXd LocalOfSites(const Eigen::VectorXd& forces_n) const { return by_sites_ * forces_n; }
  Eigen::VectorXd LocalOfMarkers(const Eigen::VectorXd& forces_n) const { return by_markers_ * forces_n; }

 private:
  const SkinMechanics& mechanics_;
  Eigen::MatrixXd near_, alike_, along_;   // markers x markers
  Eigen::MatrixXd by_sites_, by_markers_;  // sites x sites, sites x markers
  std::array<Eigen::VectorXd, 3> stray_n_;
  Eigen::MatrixXf scaled_, stray_mm2_;
};

}  // namespace taclink
