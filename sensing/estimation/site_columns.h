#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sensing/estimation/linearization.h"
#include "sensing/estimation/ring_covariance.h"

namespace taclink {

/// Displacements of the stacked markers by inward loads of 1 N, mm/N, one column per load: those of a site's
/// number act there, spread over its neighbors; from site_count() on they are shared by a row of sites.
Eigen::MatrixXf InwardColumns(const SkinMechanics& mechanics, const Linearization& skin,
                              std::span<const int> loads);

/// The columns of all loads of a skin of revolution, sites and bands, whitened by a covariance that is
/// invariant under the same rotations: those of the first group of sites, rotated, and their block-circulant
/// Gram matrix.
struct RotatedColumns {
  /// @pre skin.is_of_revolution().
  RotatedColumns(const SkinMechanics& mechanics, const RingCovariance& covariance, const Linearization& skin);

  std::vector<int> loads;  ///< by column; from site_count() on: the bands, row by row
  Eigen::MatrixXf whitened, gram;
};

}  // namespace taclink
