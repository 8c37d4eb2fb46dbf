// Limits of detection: the part of LoadEstimator about what it can't see.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "sensing/estimation/load_estimator.h"
#include "sensing/shell/dense.h"

namespace taclink {

const Eigen::VectorXd& LoadEstimator::FreeNorms() {
  assert(columns_.HasAll());
  if (free_norms_.size() > 0) return free_norms_;
  const Eigen::VectorXf own = columns_.gram().diagonal();
  Eigen::VectorXf squares = own;
  if (hidden_.cols() > 0) {
    Eigen::MatrixXf shadows;
    dense::TransposedProduct(hidden_.cast<float>(), columns_.columns(), shadows);
    squares -= shadows.colwise().squaredNorm().transpose();
  }
  free_norms_.resize(own.size());
  for (Eigen::Index place = 0; place < own.size(); ++place)
    free_norms_[columns_.loads()[static_cast<size_t>(place)]] =
        std::sqrt(std::max(squares[place], kRounding * own[place]));
  return free_norms_;
}

// A load of F at a site is expected to explain chi^2 = F^2 |column|^2 and has to explain kHillGain, beside
// noise of one standard deviation in the root of it.
// A band is let in by the penalty of Select, a body by what it has to explain.
const DetectionLimits& LoadEstimator::Limits() {
  const int sites = mechanics_.site_count();
  if (limits_.by_site_n.size() == sites) return limits_;
  constexpr double kSurely = 1.645;  // standard deviations: 95 of 100
  const Eigen::VectorXd sigmas_n = FreeNorms().cwiseInverse();
  const double least_n = kLeastHillN * mechanics_.force_unit();
  limits_.by_site_n = ((std::sqrt(kHillGain) + kSurely) * sigmas_n.head(sites)).cwiseMax(least_n);
  limits_.around_n = least_n;
  for (int row = 0; row < mechanics_.site_rows(); ++row) {
    if (!mechanics_.IsBeyondMarkers(row * mechanics_.columns()))
      limits_.around_n = std::max(limits_.around_n, (kBandSparsity + kSurely) * sigmas_n[sites + row]);
  }
  return limits_;
}

}  // namespace taclink
