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

/// Estimates the specific force from the shape of the skin alone, every 3 s: a measured one that is wrong (a
/// link that is mounted otherwise, joints with a wrong zero) distorts the whole estimate, phantom contacts
/// included, so that it must be left out to be tested. While it is contradicted it stays left out, and forces
/// stay right. One thread.
class AttitudeCheck {
 public:
  static constexpr double kLimit = 3;  ///< of AttitudeDisagreement::deviations

  /// The known loads to estimate a frame with: the measured ones, or with a specific force that is unknown.
  MeasuredLoads LoadsOf(const MeasuredLoads& measured, int64_t exposure_ns);
  /// After the frame's estimate.
  void Observe(const MeasuredLoads& measured, const MeasuredLoads& baseline, const SkinEstimate& estimate);
  void Restart() { *this = {}; }

  /// Of the newest untouched frame that was tested; none: they agree.
  const std::optional<AttitudeDisagreement>& disagreement() const { return disagreement_; }

 private:
  std::optional<AttitudeDisagreement> disagreement_;
  bool tests_ = false;       // in the frame in work
  int64_t tested_ns_ = 0;    // exposure of the frame that was tested last; 0: none
  int64_t exposure_ns_ = 0;  // of the frame in work
};

}  // namespace taclink
