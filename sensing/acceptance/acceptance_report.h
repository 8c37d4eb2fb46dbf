#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/load_errors.h"
#include "sensing/acceptance/statistics.h"

namespace taclink {

enum class Verdict : uint8_t {
  kPassed,
  kFailed,
  kUndecided,    ///< the confidence interval contains the limit: more trials are needed
  kNotMeasured,  ///< there are no usable trials for it
  kUnlimited,    ///< measured; there is no limit
};
inline constexpr const char* kVerdictNames[] = {"passed", "failed", "undecided", "not measured", "no limit"};
inline const char* Name(Verdict verdict) {
  return kVerdictNames[static_cast<size_t>(verdict)];
}

/// One measure of the link's accuracy against its limit.
struct AcceptanceQuantity {
  std::string id = {};     ///< stable, such as "force_bias"
  std::string label = {};  ///< for display
  std::string unit = {};   ///< of all numbers here: "%", "mm", "N", ...
  double value = 0;
  std::optional<double> low = {}, high = {};  ///< bounds of the 95 % confidence interval; none: too few data
  int loads = 0;                              ///< number of loads evaluated
  double limit = 0;                           ///< limit of the magnitude; 0: none
  Verdict verdict = Verdict::kNotMeasured;
};

/// Causes that the errors identify.
enum class FindingId : uint8_t {
  kForceScale,      ///< forces are off by a factor, also at the lowest pressure: modulus or thickness
  kPressureSensor,  ///< gain or offset of the pressure sensor is wrong
  kCreep,           ///< the skin creeps more than the model says
  kMounting,        ///< contacts are displaced by a rigid motion: link pose, or path numbering
  kCamera,          ///< the cameras moved or changed since the calibration
  kPressureEffect,  ///< the force error depends on the pressure
  kAttitudeEffect,  ///< the force error depends on the attitude
  kPhantom,         ///< forces where nothing touches
  kWithheld,        ///< loads that the link did not measure, or reasons that it reported
  kMissed,          ///< loads that were not detected
};
inline constexpr const char* kFindingNames[] = {
    "force_scale",     "pressure_sensor", "creep",   "mounting", "camera",
    "pressure_effect", "attitude_effect", "phantom", "withheld", "missed"};
inline const char* Name(FindingId id) {
  return kFindingNames[static_cast<size_t>(id)];
}

struct AcceptanceFinding {
  FindingId id = FindingId::kWithheld;
  std::string text = {};  ///< what, how much, and what to do
};

struct AcceptanceReport {
  Verdict verdict = Verdict::kNotMeasured;
  /// Numbers of trials; withheld: measured without usable frames; missed: the load was not detected.
  int measured = 0, skipped = 0, open = 0, withheld = 0, missed = 0;
  std::vector<AcceptanceQuantity> quantities = {};
  std::vector<AcceptanceFinding> findings = {};
  std::vector<LoadError> loads = {};

  const AcceptanceQuantity* Quantity(const std::string& id) const;
};

/// Evaluates the trials of a record, finished or not.
AcceptanceReport AnalyzeAcceptance(const AcceptanceRecord& record);

}  // namespace taclink
