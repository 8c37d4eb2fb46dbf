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
  /// Between the changes since the baseline, as the skin shows them and as they are measured; where either is
  /// below 1 m/s^2, between the specific forces.
  double angle_deg = 0;
};

/// How far the estimate's errors of the specific force, now less in the baseline (errors that both have in
/// common make no difference), are off by the measurements' standard deviations. 0: it is taken as exact.
double AttitudeDeviations(const MeasuredLoads& measured, const MeasuredLoads& baseline,
                          const LoadEstimate& loads);

/// Estimates the specific force from the shape of the skin alone, every 3 s: a measured one that is wrong (a
/// link that is mounted otherwise, joints with a wrong zero) distorts the whole estimate, phantom contacts
/// included, so that it must be left out to be tested. While it is contradicted it stays left out, and forces
/// stay right. Contacts may look like weight: a touched skin contradicts a measurement only if the frame
/// before, estimated with that measurement, did so as well or had no answer. One thread.
class AttitudeCheck {
 public:
  static constexpr double kLimit = 3;  ///< of AttitudeDisagreement::deviations

  /// The known loads to estimate a frame with: the measured ones, or with a specific force that is unknown.
  MeasuredLoads LoadsOf(const MeasuredLoads& measured, int64_t exposure_ns);
  /// After the frame's estimate.
  void Observe(const MeasuredLoads& measured, const MeasuredLoads& baseline, const SkinEstimate& estimate);
  void Restart() { *this = {}; }

  /// Of the newest frame that could be tested; none: they agree.
  const std::optional<AttitudeDisagreement>& disagreement() const { return disagreement_; }

 private:
  std::optional<AttitudeDisagreement> disagreement_;
  bool is_testing_ = false;       // in the frame in work
  bool is_contradicted_ = false;  // by the newest frame that was estimated with the measurement
  int64_t last_test_ns_ = 0;      // exposure of the frame that was tested last; 0: none
  int64_t exposure_ns_ = 0;       // of the frame in work
};

}  // namespace taclink
