#include "sensing/simulation/nonlinear_skin.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink {

Result<std::unique_ptr<SimulatedSkin>> NonlinearSkin::Make(const LinkModel& model, const Scene& scene) {
  auto plans = PlanContacts(model, scene);
  if (!plans) return plans.error();
  SceneSolver solver(model, scene, *plans);
  auto solved = solver.Solve();
  if (!solved) return solved.error();
  return std::unique_ptr<SimulatedSkin>(
      new NonlinearSkin(model, scene, std::move(*plans), solver.mesh(), std::move(*solved)));
}

NonlinearSkin::NonlinearSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
                             ShellMesh mesh, SolvedScene solved)
    : model_(model),
      scene_(scene),
      plans_(std::move(plans)),
      mesh_(std::move(mesh)),
      parts_(std::move(solved.parts)),
      writer_(model_, mesh_),
      finder_(model_, mesh_),
      nodes_{mesh_.mid_mm, mesh_.normals} {
  char text[128];
  const double megabytes = 1e-6 * solved.keys * 2 * 6 * sizeof(float) * mesh_.node_count();
  std::snprintf(text, sizeof text, "%d equilibria of %d nodes, %.1f MB, solved with %d factorizations",
                solved.keys, mesh_.node_count(), megabytes, solved.factorizations);
  preparation_ = text;
}

void NonlinearSkin::Evaluate(double time_s, SkinTruth& truth) {
  const double t = StartTruth(scene_, time_s, truth);
  truth.specific_force_mps2 = scene_.SpecificForceOf(model_.length_mm, t);
  const auto part = std::find_if(parts_.begin(), parts_.end() - 1,
                                 [&](const PlayedPart& played) { return t < played.part.end_s; });
  const std::vector<SkinKey>& keys = part->keys;
  const auto after = std::find_if(keys.begin() + 1, keys.end() - (keys.size() > 1 ? 1 : 0),
                                  [&](const SkinKey& key) { return t < key.time_s; });
  const SkinKey& from = *(after - 1);
  const SkinKey& to = keys.size() > 1 ? *after : from;
  if (keys.size() > 1)
    place_ = PlaceAt(from, to, t);
  else
    place_ = from.place;
  for (size_t i = 0; i < nodes_.mids_mm.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    nodes_.mids_mm[i] = mesh_.mid_mm[i] + place_.segment<3>(at).cast<double>();
    nodes_.directors[i] = mesh_.normals[i] + place_.segment<3>(at + 3).cast<double>();
  }
  writer_.Write(nodes_, truth);
  truth.contacts.clear();
  truth.total_force_n.setZero();
  for (size_t i = 0; i < plans_.size(); ++i) {
    if (part->part.pressing[i] && plans_[i].Level(t) > 0) WriteContact(i, t, from, to, truth);
  }
}

void NonlinearSkin::WriteContact(size_t index, double time_s, const SkinKey& from, const SkinKey& to,
                                 SkinTruth& truth) {
  const KeyContact::Numbers numbers =
      &from == &to ? from.contacts[index].value : ContactAt(from, to, index, time_s);
  TrueContact contact;
  contact.index = static_cast<int>(index);
  contact.force_n = numbers.head<3>().cast<double>();
  contact.center_mm = numbers.segment<3>(3).cast<double>();
  contact.depth_mm = numbers[6];
  const SkinSpot spot = plans_[index].SpotAt(time_s);
  finder_.AtPoint(spot.angle_rad, spot.z_mm, center_);
  Vec3 normal = Vec3::Zero();
  for (const NodeWeight& w : center_) normal += w.weight * nodes_.directors[static_cast<size_t>(w.node)];
  contact.normal = normal.normalized();
  contact.patch_diameter_mm = scene_.contacts[index].patch_diameter_mm;
  contact.limited = from.contacts[index].limited || to.contacts[index].limited;
  truth.contacts.push_back(contact);
  truth.total_force_n += contact.force_n;
}

}  // namespace taclink
