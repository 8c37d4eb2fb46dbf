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
  kNotMeasured,  ///< the plan has no trials for it
  kUnlimited,    ///< measured; there is no limit
};
inline constexpr const char* kVerdictNames[] = {"passed", "failed", "undecided", "not measured", "no limit"};
inline const char* Name(Verdict verdict) {
  return kVerdictNames[static_cast<size_t>(verdict)];
}

/// One measure of the link's accuracy against its limit.
struct AcceptanceQuantity {
  std::string id = {};     ///< stable: "force_bias"
  std::string label = {};  ///< for people
  std::string unit = {};   ///< "%", "mm", "N", ...; of all numbers here
  double value = 0;
  std::optional<double> low = {}, high = {};  ///< of the 95 % confidence interval; none: too few data
  int loads = 0;                              ///< that it comes from
  double limit = 0;                           ///< of the magnitude; 0: none
  Verdict verdict = Verdict::kNotMeasured;
};

/// What is wrong with a link, as far as the errors tell it.
enum class FindingId : uint8_t {
  kForceScale,      ///< forces are wrong by a factor, also without pressure: the modulus or thickness
  kPressureSensor,  ///< the sensor's gain or offset is wrong
  kCreep,           ///< the skin creeps, and the model does not know it
  kMounting,        ///< contacts lie off by a rigid motion: pose, or markers numbered from another path
  kCamera,          ///< cameras moved or changed since the calibration
  kPressureEffect,  ///< the force error depends on the pressure
  kAttitudeEffect,  ///< the force error depends on the attitude
  kPhantom,         ///< forces where nothing touches
  kWithheld,        ///< loads that the link did not measure, with its own reason
  kMissed,          ///< loads that were not felt
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
  /// Trials; withheld: measured without usable frames; missed: nothing was felt of the load.
  int measured = 0, skipped = 0, open = 0, withheld = 0, missed = 0;
  std::vector<AcceptanceQuantity> quantities = {};
  std::vector<AcceptanceFinding> findings = {};
  std::vector<LoadError> loads = {};

  const AcceptanceQuantity* Quantity(const std::string& id) const;
};

/// What the trials of a record say, finished or not.
AcceptanceReport AnalyzeAcceptance(const AcceptanceRecord& record);

}  // namespace taclink
