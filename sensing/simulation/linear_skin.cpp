#include "sensing/simulation/linear_skin.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace taclink {
namespace {

constexpr int kPathSamples = 400;  // places of a moving contact at which it may load new nodes

Eigen::VectorXd Flat(const ShellDisplacement& d) {
  const auto n = static_cast<Eigen::Index>(d.translations_mm.size());
  Eigen::VectorXd state(6 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    state.segment<3>(3 * i) = d.translations_mm[static_cast<size_t>(i)];
    state.segment<3>(3 * (n + i)) = d.rotations_rad[static_cast<size_t>(i)];
  }
  return state;
}

}  // namespace

Result<std::unique_ptr<SimulatedSkin>> LinearSkin::Make(const LinkModel& model, const Scene& scene,
                                                        std::shared_ptr<const LinearShell> shell) {
  if (model.relaxation.any())
    return Error{ErrorCode::kInvalidArgument,
                 "scene '" + scene.name + "': the linear skin does not creep, and model '" + model.name +
                     "' has skin.material.relaxation; use 'skin: nonlinear'"};
  auto plans = PlanContacts(model, scene);
  if (!plans) return plans.error();
  std::vector<SkinContact> contacts;
  for (const ContactPlan& plan : *plans) {
    SkinContact contact;
    contact.plan = plan;
    contacts.push_back(std::move(contact));
  }
  if (!shell) shell = std::make_shared<const LinearShell>(model, kSimulatedRefinement);
  return std::unique_ptr<SimulatedSkin>(new LinearSkin(model, scene, std::move(shell), std::move(contacts)));
}

LinearSkin::LinearSkin(const LinkModel& model, const Scene& scene, std::shared_ptr<const LinearShell> shell,
                       std::vector<SkinContact> contacts)
    : model_(model),
      scene_(scene),
      shell_(std::move(shell)),
      finder_(model, shell_->mesh()),
      writer_(model, shell_->mesh()),
      per_pressure_(Flat(shell_->PerPressure())),
      response_of_node_(static_cast<size_t>(mesh().node_count()), -1),
      contacts_(std::move(contacts)),
      pressed_(State::Zero(per_pressure_.size())),
      state_(pressed_) {
  for (size_t i = 0; i < mesh().mid_mm.size(); ++i) {
    const Vec3& p = mesh().mid_mm[i];
    radial_.push_back(Vec3(p.x(), p.y(), 0).normalized());
  }
  nodes_ = {mesh().mid_mm, mesh().normals};
  active_.reserve(contacts_.size());
  for (size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].patch.reserve(response_of_node_.size());
    contacts_[i].center.reserve(4);
    contacts_[i].response = State::Zero(state_.size());
    Place(contacts_[i], contacts_[i].plan.begin_s, scene_.contacts[i].patch_diameter_mm);
    LearnResponses(contacts_[i], scene_.contacts[i].patch_diameter_mm);
  }
}

// A contact that stays needs the response to its load; one that moves, those to every node it will load.
void LinearSkin::LearnResponses(SkinContact& contact, double diameter_mm) {
  if (!contact.plan.moves) {
    std::vector<NodalLoad> loads;
    loads.reserve(contact.patch.size());
    for (const NodeWeight& w : contact.patch)
      loads.push_back({w.node, -w.weight / contact.normal_share * Normal(w.node)});
    contact.response = Flat(shell_->Solve(loads));
    return;
  }
  const double generous_mm = 1.1 * diameter_mm + 1;  // no node may be missed between two samples of the path
  std::vector<NodeWeight> weights;
  for (int i = 0; i <= kPathSamples; ++i) {
    const double share = static_cast<double>(i) / kPathSamples;
    const SkinSpot spot =
        contact.plan.SpotAt(contact.plan.begin_s + share * (contact.plan.end_s - contact.plan.begin_s));
    finder_.AtPatch(spot.angle_rad, spot.z_mm, generous_mm, weights);
    for (const NodeWeight& w : weights) {
      const auto node = static_cast<size_t>(w.node);
      if (response_of_node_[node] >= 0) continue;
      response_of_node_[node] = static_cast<int>(unit_responses_.size());
      const NodalLoad load{w.node, -Normal(w.node)};
      unit_responses_.push_back(Flat(shell_->Solve({&load, 1})));
    }
  }
}

void LinearSkin::Place(SkinContact& contact, double time_s, double diameter_mm) {
  contact.spot = contact.plan.SpotAt(time_s);
  finder_.AtPatch(contact.spot.angle_rad, contact.spot.z_mm, diameter_mm, contact.patch);
  finder_.AtPoint(contact.spot.angle_rad, contact.spot.z_mm, contact.center);
  Vec3 resultant = Vec3::Zero();
  for (const NodeWeight& w : contact.patch) resultant += w.weight * Normal(w.node);
  contact.normal_share = resultant.norm();
  if (unit_responses_.empty()) return;
  contact.response.setZero();
  for (const NodeWeight& w : contact.patch) {
    const int response = response_of_node_[static_cast<size_t>(w.node)];
    if (response >= 0)
      contact.response += w.weight / contact.normal_share * unit_responses_[static_cast<size_t>(response)];
  }
}

void LinearSkin::Evaluate(double time_s, SkinTruth& truth) {
  const double t = StartTruth(scene_, time_s, truth);
  active_.clear();
  for (size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].level = contacts_[i].plan.Level(t);
    if (contacts_[i].level <= 0) continue;
    if (contacts_[i].plan.moves) Place(contacts_[i], t, scene_.contacts[i].patch_diameter_mm);
    active_.push_back(i);
  }
  state_ = truth.pressure_mpa * per_pressure_;
  ContactForces forces = Forces(truth.pressure_mpa);
  pressed_.setZero();
  for (size_t k = 0; k < active_.size(); ++k) pressed_ += forces[k].force_n * contacts_[active_[k]].response;
  const double scale = active_.empty() ? 1 : FreeScale(state_, pressed_);
  state_ += scale * pressed_;
  for (int node = 0; node < mesh().node_count(); ++node) {
    const auto i = static_cast<size_t>(node);
    nodes_.mids_mm[i] = mesh().mid_mm[i] + Shift(state_, node);
    nodes_.directors[i] = Director(node);
  }
  writer_.Write(nodes_, truth);
  truth.contacts.clear();
  truth.total_force_n.setZero();
  for (size_t k = 0; k < active_.size(); ++k) {
    forces[k].force_n *= scale;
    forces[k].limited = forces[k].limited || scale < 1;
    WriteContact(active_[k], forces[k], truth);
  }
}

ContactForces LinearSkin::Forces(double pressure_mpa) {
  const auto n = static_cast<Eigen::Index>(active_.size());
  ContactMatrix compliance(n, n);
  ContactVector free_depth(n);
  ContactDemands demands;
  for (Eigen::Index i = 0; i < n; ++i) {
    const size_t index = active_[static_cast<size_t>(i)];
    const SkinContact& contact = contacts_[index];
    const SceneContact& plan = scene_.contacts[index];
    free_depth(i) = pressure_mpa * InwardDepth(per_pressure_, contact);
    for (Eigen::Index j = 0; j < n; ++j)
      compliance(i, j) = InwardDepth(contacts_[active_[static_cast<size_t>(j)]].response, contact);
    demands[static_cast<size_t>(i)] = {plan.depth_mm.has_value(), contact.level * plan.force_n.value_or(0),
                                       plan.depth_mm.value_or(0), contact.level,
                                       MostDepth(model_, contact.spot)};
  }
  return BalanceContacts(demands, compliance, free_depth);
}

// The largest share of the contacts' deformation, at most 1, that keeps every node's wall outside the tube.
double LinearSkin::FreeScale(const State& without, const State& contacts) const {
  const double nearest = NearestWall(model_);
  double scale = 1;
  for (int node = 0; node < mesh().node_count(); ++node) {
    const auto i = static_cast<size_t>(node);
    // Along the node's own radius; the wall turns little where a dent is deepest.
    const double before = writer_.rest_wall_radius_mm()[i] + radial_[i].dot(Shift(without, node));
    const double inward = -radial_[i].dot(Shift(contacts, node));
    if (inward > 0 && before - scale * inward < nearest) scale = std::max(0.0, (before - nearest) / inward);
  }
  return scale;
}

double LinearSkin::InwardDepth(const State& state, const SkinContact& contact) const {
  double depth = 0;
  for (const NodeWeight& w : contact.center) depth -= w.weight * Normal(w.node).dot(Shift(state, w.node));
  return depth;
}

Vec3 LinearSkin::Director(int node) const {
  const Vec3& rest = mesh().normals[static_cast<size_t>(node)];
  const Vec3 rotation = state_.segment<3>(Eigen::Index{3} * (mesh().node_count() + node));
  return rest + rotation.cross(rest);
}

void LinearSkin::WriteContact(size_t index, ContactForce force, SkinTruth& truth) const {
  const SkinContact& contact = contacts_[index];
  TrueContact result;
  result.index = static_cast<int>(index);
  Vec3 shift = Vec3::Zero(), turn = Vec3::Zero();
  for (const NodeWeight& w : contact.center) {
    const Vec3& rest = mesh().normals[static_cast<size_t>(w.node)];
    shift += w.weight * (Shift(state_, w.node) + model_.thickness_mm / 2 * (Director(w.node) - rest));
    turn += w.weight * (Director(w.node) - rest);
  }
  const Vec3 at_rest = model_.PointAtDepth(contact.spot.angle_rad, contact.spot.z_mm, 0);
  result.center_mm = at_rest + shift;
  result.normal = (model_.OutwardNormal(contact.spot.angle_rad, contact.spot.z_mm) + turn).normalized();
  for (const NodeWeight& w : contact.patch)
    result.force_n -= force.force_n * w.weight / contact.normal_share * Normal(w.node);
  result.depth_mm = -shift.dot(model_.OutwardNormal(contact.spot.angle_rad, contact.spot.z_mm));
  result.patch_diameter_mm = scene_.contacts[index].patch_diameter_mm;
  result.limited = force.limited;
  truth.contacts.push_back(result);
  truth.total_force_n += result.force_n;
}

}  // namespace taclink
