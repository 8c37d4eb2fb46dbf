#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sensing/acceptance/acceptance.h"

namespace taclink {

/// Errors of one measured load or pressure against its reference; what was not compared is absent.
struct LoadError {
  uint32_t trial = 0;
  int place = 0;                     ///< loads with the same number were at the same place
  int condition = 0;                 ///< likewise the same place, force, pressure and attitude: repetitions
  std::optional<double> force = {};  ///< (measured - reference) / reference; -1: no contact was found
  std::optional<double> force_to_floor = {};  ///< (measured - reference) / the larger of reference and floor
  std::optional<double> place_mm = {};        ///< distance from the reference place, along the skin
  std::optional<double> balance = {};  ///< |resultant of all contacts - load| / the larger of load and floor
  std::optional<double> ghost_n = {};  ///< all forces after the load was taken off
  std::optional<double> phantom_n = {};  ///< of other contacts during the load
  std::optional<double> pressure_kpa =
      {};  ///< inside the skin: manometer, else planned, else the link's sensor
  std::string attitude = {};
  double hours = 0;  ///< since the first reading
};

/// Of all measured loads whose readings can be used. A reading can be used if at least half of its frames
/// have forces.
std::vector<LoadError> LoadErrors(const AcceptanceRecord& record);

/// A measured place moved to the reference's distance from the axis: a load presses its contact inwards,
/// which is not an error of the place.
Vec3 AtRadiusOf(const Vec3& reference_mm, const Vec3& measured_mm);

bool IsUsable(const TrialReading& reading);
/// References below this compare nothing: relative errors would say nothing. N.
inline constexpr double kLeastReferenceN = 0.02;
/// The force that the load really had: of the reading's reference, else as planned.
std::optional<double> ReferenceForce(const AcceptanceTrial& trial);

}  // namespace taclink
