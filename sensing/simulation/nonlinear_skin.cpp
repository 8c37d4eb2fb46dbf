#include "sensing/simulation/nonlinear_skin.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink {
namespace {

KeyContact::Numbers NumbersAt(const SkinKey& from, const SkinKey& to, size_t contact, double time_s) {
  return &from == &to ? from.contacts[contact].value : ContactAt(from, to, contact, time_s);
}

}  // namespace

Result<std::unique_ptr<SimulatedSkin>> NonlinearSkin::Make(const LinkModel& model, const Scene& scene,
                                                           const SceneProgress& progress) {
  auto plans = PlanContacts(model, scene);
  if (!plans) return plans.error();
  SceneSolver solver(model, scene, *plans, {}, progress);
  auto solved = solver.Solve();
  if (!solved) return solved.error();
  return std::unique_ptr<SimulatedSkin>(new NonlinearSkin(model, scene, std::move(*plans), solver.mesh(),
                                                          std::move(*solved), solver.loads().free_skins()));
}

NonlinearSkin::NonlinearSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
                             ShellMesh mesh, SolvedScene solved, std::vector<ShellState> free_skins)
    : model_(model),
      scene_(scene),
      plans_(std::move(plans)),
      mesh_(std::move(mesh)),
      parts_(std::move(solved.parts)),
      free_skins_(std::move(free_skins)),
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
  if (scene_.motion && scene_.motion->swing) truth.joint = scene_.motion->swing->At(t);
  if (!EvaluateLive(time_s, truth)) Play(t, truth);
  truth.trouble = trouble_;
  writer_.Write(nodes_, truth);
}

// False: nobody handles the skin.
bool NonlinearSkin::EvaluateLive(double time_s, SkinTruth& truth) {
  if (!is_live_ && !handling_.any()) return false;
  if (!is_live_) {
    trouble_.clear();
    if (!live_) live_ = std::make_unique<LiveSkin>(model_, scene_, plans_, free_skins_);
    Play(scene_.SceneTime(time_s), truth);
    is_live_ = live_->Begin(time_s, nodes_, pressing_);
    if (!is_live_) trouble_ = "the skin can't be handled at this moment of its scene";
  }
  if (is_live_) {
    is_live_ = live_->Evaluate(time_s, handling_, nodes_, truth);
    trouble_ = live_->trouble();
  }
  return is_live_;
}

void NonlinearSkin::Play(double scene_time_s, SkinTruth& truth) {
  const double t = scene_time_s;
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
  truth.contacts.clear();
  truth.total_force_n.setZero();
  pressing_ = from.contacts;
  for (size_t i = 0; i < plans_.size(); ++i) {
    pressing_[i].value = NumbersAt(from, to, i, t);
    if (part->part.pressing[i] && plans_[i].Level(t) > 0) WriteContact(i, t, from, to, truth);
  }
}

void NonlinearSkin::WriteContact(size_t index, double time_s, const SkinKey& from, const SkinKey& to,
                                 SkinTruth& truth) {
  const KeyContact::Numbers numbers = NumbersAt(from, to, index, time_s);
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
