#pragma once

#include <Eigen/Core>
#include <memory>

#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// Gaussian bells of the distances between sites. They depend on the rows of both sites and on the number of
/// columns between them, so that only those about one column of sites are stored. Immutable.
class SiteBells {
 public:
  SiteBells() = default;
  SiteBells(const SkinMechanics& mechanics, double width_mm);
  double operator()(int site, int other) const;
  /// Adds `scale` times the bell about `site` to a sum by site.
  void AddTo(Eigen::Ref<Eigen::VectorXd> sum, int site, double scale) const;

 private:
  int columns_ = 1;
  Eigen::MatrixXd about_first_;  // sites x rows: about the first site of each row
};

/// How near the sites and markers of a skin at rest are to each other: Gaussian bells of their distance, over
/// the lengths within which errors are alike and loads are neighbors. Constant.
struct Neighborhoods {
  explicit Neighborhoods(const SkinMechanics& mechanics);
  /// The same object for all skins with the same markers and sites that are in use. Any thread.
  static std::shared_ptr<const Neighborhoods> SharedFor(const SkinMechanics& mechanics);

  Eigen::MatrixXd motion_near, motion_alike;  ///< markers x markers: of the error by motion
  Eigen::MatrixXd growth_alike;               ///< markers x markers: of the error by inflation
  SiteBells local_sites;                      ///< which forces count as nearby for stray ones
  Eigen::MatrixXd local_markers;              ///< sites x markers, likewise
  SiteBells load_sites;                       ///< how much of a load lifts the penalty there
};

}  // namespace taclink
