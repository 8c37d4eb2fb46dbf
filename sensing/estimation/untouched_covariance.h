#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "sensing/estimation/marker_covariance.h"

namespace taclink {

/// Independent errors of known loads, of unit variance each: a matrix R with R R' their covariance. Rows as
/// in KnownLoads::Stacked(); no columns: they are exact.
using KnownLoadsErrors = Eigen::Matrix<double, KnownLoads::kCount, Eigen::Dynamic, Eigen::ColMajor,
                                       KnownLoads::kCount, KnownLoads::kCount>;
/// The pressure's first, then those of the specific force, if there are any.
KnownLoadsErrors ErrorsOf(double pressure_sigma_mpa, const Mat3& specific_force_covariance);

/// What is known of the known loads before the skin is looked at.
struct KnownLoadsPrior {
  KnownLoadsErrors now = KnownLoadsErrors(KnownLoads::kCount, 0);
  KnownLoadsErrors baseline = now;   ///< of the loads under which the baseline was taken
  Eigen::MatrixXd baseline_mm = {};  ///< what the latter do to the baseline's stacked markers; empty: nothing

  /// Standard deviations that differ by less than kSameNoise.
  bool IsAbout(const KnownLoadsErrors& errors) const;
};

/// Observations by cameras are as good as others whose standard deviations are no more than that times
/// theirs; this share of the markers may differ.
constexpr double kSameNoise = 2, kOtherNoiseShare = 0.02;

/// The covariance of the markers' errors that loads, the known ones and the cameras' motion do not change: of
/// the cameras' noise and of the model where nothing presses. Made of the skin without loads, it is shared by
/// the tangents of the touched skin, which add what is more. Immutable.
struct UntouchedCovariance {
  /// Returns nullptr if the covariance is not positive definite. If `skin` is of revolution and the cameras
  /// see few markers much better or worse than others of the same ring, their noise is averaged over the
  /// ring, so that the covariance is invariant under rotation; what is worse is left to the tangents.
  static std::shared_ptr<const UntouchedCovariance> Make(const Linearization& skin,
                                                         const MarkerCovariance& model,
                                                         const MarkerObservations& observed,
                                                         const KnownLoadsPrior& prior);

  /// For a skin that is touched: some that are worse or missing do not matter. False: some are better, many
  /// worse or missing, or they count from another baseline.
  bool IsGoodFor(const MarkerObservations& observed, const KnownLoadsPrior& prior) const;

  double unseen_mm = 0;          ///< standard deviation of a direction in which a marker is not seen
  std::vector<Mat3> noise_mm2;   ///< by marker, of the cameras; the median where they do not see it
  std::vector<Mat3> marker_mm2;  ///< by marker, without noise, baseline and bow
  /// What 1 N of a stray force moves the markers by, all together, mm; by direction and row of sites.
  std::array<Eigen::VectorXd, 3> stray_mm_per_n;
  double usual_noise_mm = 0;       ///< median over the markers of the coordinate that is known best
  Eigen::MatrixXd by_baseline_mm;  ///< stacked, by the baseline's errors of known loads
  KnownLoadsErrors baseline_errors;
  bool HasBaseline(const KnownLoadsPrior& prior) const;
  /// Few of the markers that it counts as seen are hidden now, in any direction, or seen worse.
  bool LosesFew(const MarkerObservations& observed) const;
  std::shared_ptr<const FactoredCovariance> factored;  ///< without the baseline's errors
  std::shared_ptr<const RingCovariance> ring;          ///< the same; null: it is not invariant under rotation
};

}  // namespace taclink
