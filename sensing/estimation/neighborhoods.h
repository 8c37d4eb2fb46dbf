#pragma once

#include <Eigen/Core>
#include <memory>

#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// How near the sites and markers of a skin at rest are to each other: Gaussian bells of their distance, over
/// the lengths within which errors are alike and loads are neighbors. Constant.
struct Neighborhoods {
  explicit Neighborhoods(const SkinMechanics& mechanics);
  /// The same object for all skins with the same markers and sites that are in use. Any thread.
  static std::shared_ptr<const Neighborhoods> SharedFor(const SkinMechanics& mechanics);

  Eigen::MatrixXd motion_near, motion_alike;  ///< markers x markers: of the error by motion
  Eigen::MatrixXd growth_alike;               ///< markers x markers: of the error by inflation
  Eigen::MatrixXd local_sites;                ///< sites x sites: which forces count as nearby for stray ones
  Eigen::MatrixXd local_markers;              ///< sites x markers, likewise
  Eigen::MatrixXd load_sites;                 ///< sites x sites: how much of a load lifts the penalty there
};

}  // namespace taclink
