#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sensing/acceptance/acceptance.h"

namespace taclink {

/// Errors of one measured load or pressure against its reference; absent: not compared.
struct LoadError {
  uint32_t trial = 0;
  int place = 0;                     ///< same number: same place
  int condition = 0;                 ///< same number: same place, force, pressure and attitude (repetitions)
  std::optional<double> force = {};  ///< (measured - reference) / reference; -1: no contact was found
  std::optional<double> force_to_floor = {};  ///< (measured - reference) / max(reference, floor)
  std::optional<double> place_mm = {};        ///< distance along the skin from the reference place
  std::optional<double> balance = {};         ///< |resultant of all contacts - load| / max(load, floor)
  std::optional<double> ghost_n = {};         ///< sum of forces after the load was removed
  std::optional<double> phantom_n = {};       ///< sum of other contacts during the load
  std::optional<double> pressure_kpa =
      {};  ///< inside the skin: from the manometer, else planned, else from the link's sensor
  std::string attitude = {};
  double hours = 0;  ///< since the first reading
};

/// Errors of all measured trials with usable readings.
std::vector<LoadError> LoadErrors(const AcceptanceRecord& record);

/// Moves a measured place to the reference's distance from the axis: a load shifts its contact inward, which
/// is not an error of place.
Vec3 AtRadiusOf(const Vec3& reference_mm, const Vec3& measured_mm);

/// Whether at least half of the reading's frames have forces.
bool IsUsable(const TrialReading& reading);
/// Loads with a smaller reference force are not compared: relative errors would be meaningless. N.
inline constexpr double kLeastReferenceN = 0.02;
/// The reference force if given, else the planned force.
std::optional<double> ReferenceForce(const AcceptanceTrial& trial);

}  // namespace taclink
