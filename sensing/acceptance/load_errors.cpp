#include "sensing/acceptance/load_errors.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "sensing/core/units.h"

namespace taclink {
namespace {

std::optional<double> BalanceError(const AcceptanceTrial& trial, double reference_n, double scale_n) {
  const TrialReference& reference = trial.reference;
  std::optional<Vec3> direction = reference.direction;
  // The profile is not known here: the radial direction approximates the skin's normal.
  if (!direction && reference.place_mm) {
    const Vec3& at = *reference.place_mm;
    const Vec3 radial(at.x(), at.y(), 0);
    if (radial.norm() > 0) direction = -radial.normalized();
  }
  if (!direction) return std::nullopt;
  return (trial.loaded->total_force_n - reference_n * *direction).norm() / scale_n;
}

std::optional<double> PressureKpa(const AcceptanceTrial& trial) {
  if (trial.reference.pressure_mpa) return *trial.reference.pressure_mpa / kMpaPerKpa;
  if (trial.pressure_mpa) return *trial.pressure_mpa / kMpaPerKpa;
  if (trial.loaded && trial.loaded->pressure_mpa) return *trial.loaded->pressure_mpa / kMpaPerKpa;
  return std::nullopt;
}

LoadError ErrorOf(const AcceptanceTrial& trial, double floor_n) {
  LoadError error{.trial = trial.id, .attitude = trial.attitude};
  error.pressure_kpa = PressureKpa(trial);
  const TrialReading& loaded = *trial.loaded;
  const auto reference_n = ReferenceForce(trial);
  if (reference_n && *reference_n >= kLeastReferenceN) {
    error.force = loaded.has_contact ? loaded.force_n / *reference_n - 1 : -1;
    const double scale_n = std::max(*reference_n, floor_n);
    error.force_to_floor = *error.force * *reference_n / scale_n;
    error.balance = BalanceError(trial, *reference_n, scale_n);
    error.phantom_n = loaded.others_n;
    if (trial.reference.place_mm && loaded.has_contact)
      error.place_mm =
          (AtRadiusOf(*trial.reference.place_mm, loaded.center_mm) - *trial.reference.place_mm).norm();
  }
  if (trial.released && IsUsable(*trial.released))
    error.ghost_n = trial.released->force_n + trial.released->others_n;
  return error;
}

template <typename Key>
int NumberOf(std::map<Key, int>& numbers, const Key& key) {
  return numbers.emplace(key, static_cast<int>(numbers.size())).first->second;
}

}  // namespace

Vec3 AtRadiusOf(const Vec3& reference_mm, const Vec3& measured_mm) {
  const double measured = std::hypot(measured_mm.x(), measured_mm.y());
  if (!(measured > 0)) return measured_mm;
  const double scale = std::hypot(reference_mm.x(), reference_mm.y()) / measured;
  return {scale * measured_mm.x(), scale * measured_mm.y(), measured_mm.z()};
}

bool IsUsable(const TrialReading& reading) {
  return reading.usable > 0 && 2 * reading.usable >= reading.frames;
}

std::optional<double> ReferenceForce(const AcceptanceTrial& trial) {
  return trial.reference.force_n ? trial.reference.force_n : trial.force_n;
}

std::vector<LoadError> LoadErrors(const AcceptanceRecord& record) {
  using Place = std::tuple<int, int, long, long, long>;
  using Condition = std::tuple<int, double, double, std::string>;
  std::map<Place, int> places;
  std::map<Condition, int> conditions;
  std::optional<int64_t> first_ns;
  std::vector<LoadError> errors;
  for (const AcceptanceTrial& trial : record.trials) {
    if (trial.state != TrialState::kMeasured || !trial.loaded || !IsUsable(*trial.loaded)) continue;
    LoadError error = ErrorOf(trial, record.limits.force_floor_n);
    // Places without a marker are the same if they fall in the same cell of a 10 mm grid.
    Place place{trial.path, trial.ring, 0, 0, 0};
    if (trial.path == 0 && trial.reference.place_mm) {
      const Vec3 at = *trial.reference.place_mm / 10;
      place = {0, 0, std::lround(at.x()), std::lround(at.y()), std::lround(at.z())};
    }
    error.place = NumberOf(places, place);
    error.condition = NumberOf(conditions, Condition{error.place, trial.force_n.value_or(0),
                                                     trial.pressure_mpa.value_or(-1), trial.attitude});
    if (!first_ns) first_ns = trial.loaded->utc_ns;
    error.hours = 1e-9 / 3600 * static_cast<double>(trial.loaded->utc_ns - *first_ns);
    errors.push_back(std::move(error));
  }
  return errors;
}

}  // namespace taclink
