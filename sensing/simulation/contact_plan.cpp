#include "sensing/simulation/contact_plan.h"

#include <algorithm>
#include <string>

namespace taclink {
namespace {

constexpr double kTubeGapMm = 0.2;  // a contact stops while the wall is this far from the tube
constexpr double kNoTubeMm = 1;     // or from the axis

double Smoothstep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Fails with the scene's line if the place is not on the model.
Result<SkinSpot> Locate(const LinkModel& model, const SkinPlace& place, const std::string& where) {
  if (place.path == 0) {
    if (place.z_mm < model.length_mm && place.z_mm > 0) return SkinSpot{place.angle_rad, place.z_mm};
    return Error{ErrorCode::kInvalidArgument, where +
                                                  ": 'z_mm' must lie between the clamped ends of model '" +
                                                  model.name + "', 0 and " + std::to_string(model.length_mm)};
  }
  if (place.path <= model.markers.paths && place.ring <= model.markers.rings())
    return SkinSpot{model.PathAngle(place.path - 1),
                    model.markers.rings_z_mm[static_cast<size_t>(place.ring - 1)]};
  return Error{ErrorCode::kInvalidArgument, where + ": marker (" + std::to_string(place.path) + ", " +
                                                std::to_string(place.ring) + ") is not on model '" +
                                                model.name + "', which has " +
                                                std::to_string(model.markers.paths) + " paths and " +
                                                std::to_string(model.markers.rings()) + " rings"};
}

}  // namespace

double ContactPlan::Level(double time_s) const {
  if (time_s < begin_s || time_s > end_s) return 0;
  if (ramp_s == 0) return 1;
  return Smoothstep((time_s - begin_s) / ramp_s) * Smoothstep((end_s - time_s) / ramp_s);
}

SkinSpot ContactPlan::SpotAt(double time_s) const {
  if (!moves) return from;
  const double share = (time_s - begin_s) / (end_s - begin_s);
  return {from.angle_rad + share * (to.angle_rad - from.angle_rad),
          from.z_mm + share * (to.z_mm - from.z_mm)};
}

Result<std::vector<ContactPlan>> PlanContacts(const LinkModel& model, const Scene& scene) {
  if (scene.contacts.size() > kMaxSceneContacts || scene.pressure.empty())
    return Error{ErrorCode::kInvalidArgument,
                 "scene '" + scene.name + "': too many contacts, or no pressure"};
  std::vector<ContactPlan> plans;
  for (const SceneContact& contact : scene.contacts) {
    const auto from = Locate(model, contact.at, contact.where);
    if (!from) return from.error();
    const auto to = Locate(model, contact.move_to.value_or(contact.at), contact.where);
    if (!to) return to.error();
    plans.push_back(
        {*from, *to, contact.move_to.has_value(), contact.begin_s, contact.end_s, contact.ramp_s});
  }
  return plans;
}

double NearestWall(const LinkModel& model) {
  return model.tube_outer_radius_mm > 0 ? model.tube_outer_radius_mm : kNoTubeMm / 2;
}

double MostDepth(const LinkModel& model, const SkinSpot& spot) {
  const double wall = model.PointAtDepth(spot.angle_rad, spot.z_mm, model.thickness_mm).head<2>().norm();
  return wall - (model.tube_outer_radius_mm > 0 ? model.tube_outer_radius_mm + kTubeGapMm : kNoTubeMm);
}

}  // namespace taclink
