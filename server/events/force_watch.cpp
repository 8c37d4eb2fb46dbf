#include "server/events/force_watch.h"

namespace taclink::server {

std::vector<bool> MarkersOf(const Region& region, const MarkerGrid& grid) {
  std::vector<bool> markers;
  for (int m = 0; m < grid.count(); ++m) markers.push_back(region.Holds(m % grid.paths, m / grid.paths));
  return markers;
}

double ForceWatch::ForceOf(const Contact& contact, const LinkState& state) const {
  if (markers_.empty()) return contact.magnitude_n();
  double within = 0, all = 0;
  for (const int marker : contact.markers) {
    const auto m = static_cast<size_t>(marker);
    if (m >= markers_.size() || m >= state.forces.forces_n.size()) continue;
    const double load = state.forces.forces_n[m].norm();
    all += load;
    if (markers_[m]) within += load;
  }
  return all > 0 ? within / all * contact.magnitude_n() : 0;
}

ForceLevel ForceWatch::LevelAt(double force_n) const {
  const auto reaches = [&](ForceLevel level, double threshold_n) {
    return threshold_n > 0 && force_n >= threshold_n - (level_ >= level ? thresholds_.hysteresis_n : 0);
  };
  if (reaches(ForceLevel::kAlarm, thresholds_.alarm_n)) return ForceLevel::kAlarm;
  if (reaches(ForceLevel::kWarning, thresholds_.warning_n)) return ForceLevel::kWarning;
  return ForceLevel::kNormal;
}

void ForceWatch::Take(const LinkState& state, std::vector<ForceLevelDetail>& told) {
  // A level stays: nobody has seen that the force is gone.
  if (!state.measured() || !state.has_forces()) return;
  const Contact* strongest = nullptr;
  force_n_ = 0;
  for (const Contact& contact : state.contacts) {
    const double force_n = ForceOf(contact, state);
    if (force_n <= force_n_) continue;
    force_n_ = force_n;
    strongest = &contact;
  }
  const ForceLevel level = LevelAt(force_n_);
  if (level == level_) return;
  told.push_back({.region = name_,
                  .level = level,
                  .previous = level_,
                  .force_n = force_n_,
                  .thresholds = thresholds_,
                  .contact_id = strongest != nullptr ? strongest->id : 0,
                  .center_mm = strongest != nullptr ? strongest->center_mm : Vec3::Zero()});
  level_ = level;
}

}  // namespace taclink::server
