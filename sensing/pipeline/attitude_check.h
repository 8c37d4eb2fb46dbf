#pragma once

#include <cstdint>
#include <optional>

#include "sensing/core/known_loads.h"
#include "sensing/estimation/skin_estimator.h"

namespace taclink {

/// How a measured specific force contradicts the skin's.
struct AttitudeDisagreement {
  Vec3 skin_mps2 = Vec3::Zero(), measured_mps2 = Vec3::Zero();
  double deviations = 0;  ///< Mahalanobis distance
  /// Between the changes since the baseline, as the skin shows them and as they are measured.
  double angle_deg = 0;
};

/// Asks the skin alone for the specific force, now and then: a measured one that is wrong (a link that is
/// mounted otherwise, joints with a wrong zero) bends the answer in all ways, contacts that are not there
/// among them, so that it must be left out to be judged. While it is contradicted it stays left out, and
/// forces are right all the same. One thread.
class AttitudeCheck {
 public:
  static constexpr double kLimit = 3;  ///< of AttitudeDisagreement::deviations

  /// The known loads to estimate a frame with: the measured ones, or with a specific force that is unknown.
  MeasuredLoads LoadsOf(const MeasuredLoads& measured, int64_t exposure_ns);
  /// After the frame's estimate.
  void Observe(const MeasuredLoads& measured, const MeasuredLoads& baseline, const SkinEstimate& estimate);
  void Restart() { *this = {}; }

  /// Of the newest frame that told; none: they agree.
  const std::optional<AttitudeDisagreement>& disagreement() const { return disagreement_; }

 private:
  std::optional<AttitudeDisagreement> disagreement_;
  bool asks_skin_ = false;   // in the frame in work
  int64_t asked_ns_ = 0;     // exposure of the frame in which the skin was asked last; 0: never
  int64_t exposure_ns_ = 0;  // of the frame in work
};

}  // namespace taclink
