#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/estimation/marker_covariance.h"

namespace taclink {

/// What is known of the pressure before the skin is looked at.
struct PressurePrior {
  double sigma_mpa = 0;
  double baseline_sigma_mpa = 0;  ///< of the pressure under which the baseline was taken
  Eigen::VectorXd baseline_mm_per_mpa =
      {};  ///< what that pressure does to the baseline's markers; empty: nothing
};

/// Observations by cameras are as good as others whose standard deviations are no more than that times
/// theirs; this share of the markers may differ.
constexpr double kSameNoise = 2, kOtherNoiseShare = 0.02;

/// The covariance of the markers' errors that loads, the pressure and the cameras' motion do not change: of
/// the cameras' noise, of the baseline, and of the model where nothing presses. Made of the skin without
/// loads, it is shared by the tangents of the touched skin, which add what is more. Constant.
struct UntouchedCovariance {
  /// Null: the covariance has no factor. Makes all columns of `skin`.
  static std::shared_ptr<const UntouchedCovariance> Make(Linearization& skin, const MarkerCovariance& model,
                                                         const MarkerObservations& observed,
                                                         const PressurePrior& prior);

  /// For a skin that is touched: some that are worse or missing do not matter. False: some are better, many
  /// worse or missing, or they count from another baseline.
  bool IsGoodFor(const MarkerObservations& observed, const PressurePrior& prior) const;

  double unseen_mm = 0;            ///< standard deviation of a direction in which a marker is not seen
  std::vector<Mat3> noise_mm2;     ///< by marker, of the cameras; usual ones where they do not see it
  std::vector<Mat3> marker_mm2;    ///< by marker, without noise and bow
  Eigen::VectorXd by_baseline_mm;  ///< stacked, of one standard deviation of the baseline's pressure
  double baseline_sigma_mpa = 0;
  bool HasBaseline(const PressurePrior& prior) const;
  /// Few of the markers that it counts as seen are hidden now, in any direction, or seen worse.
  bool LosesFew(const MarkerObservations& observed) const;
  Eigen::MatrixXf covariance_mm2;  ///< lower half
  Eigen::MatrixXf factor;          ///< of that, lower
};

}  // namespace taclink
