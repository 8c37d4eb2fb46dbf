#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sensing/estimation/linearization.h"
#include "sensing/estimation/ring_covariance.h"

namespace taclink {

/// Displacements of the stacked markers by 1 N inward at each of these sites, spread over its neighbors;
/// mm/N, one column per site.
Eigen::MatrixXf SiteColumns(const SkinMechanics& mechanics, Linearization& skin, std::span<const int> sites);

/// The columns of all loads of a skin of revolution, sites and bands, whitened by a covariance that is
/// invariant under the same rotations: those of the first group of sites, rotated, and their block-circulant
/// Gram matrix.
struct RotatedColumns {
  /// @pre skin.is_of_revolution().
  RotatedColumns(const SkinMechanics& mechanics, const RingCovariance& covariance, Linearization& skin);

  std::vector<int> loads;  ///< by column; from site_count() on: the bands, row by row
  Eigen::MatrixXf whitened, gram;
};

}  // namespace taclink
