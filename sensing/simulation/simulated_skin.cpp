#include "sensing/simulation/simulated_skin.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace taclink {
namespace {

constexpr double kTubeGapMm = 0.2;  // the wall stops this far from the tube
constexpr double kNoTubeMm = 1;     // the wall stops this far from the axis
constexpr int kPathSamples = 400;   // places of a moving contact at which it may load new nodes
constexpr double kMpaPerKpa = 1e-3;

double Smoothstep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double RampLevel(const SceneContact& plan, double time_s) {
  if (time_s < plan.begin_s || time_s > plan.end_s) return 0;
  if (plan.ramp_s == 0) return 1;
  return Smoothstep((time_s - plan.begin_s) / plan.ramp_s) * Smoothstep((plan.end_s - time_s) / plan.ramp_s);
}

Eigen::VectorXd Flat(const ShellDisplacement& d) {
  const auto n = static_cast<Eigen::Index>(d.translations_mm.size());
  Eigen::VectorXd state(6 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    state.segment<3>(3 * i) = d.translations_mm[static_cast<size_t>(i)];
    state.segment<3>(3 * (n + i)) = d.rotations_rad[static_cast<size_t>(i)];
  }
  return state;
}

// Fails with the scene's line if the place is not on the model.
Result<std::pair<double, double>> Locate(const LinkModel& model, const SkinPlace& place,
                                         const std::string& where) {
  if (place.path == 0) {
    if (place.z_mm < model.length_mm && place.z_mm > 0) return std::pair(place.angle_rad, place.z_mm);
    return Error{ErrorCode::kInvalidArgument, where +
                                                  ": 'z_mm' must lie between the clamped ends of model '" +
                                                  model.name + "', 0 and " + std::to_string(model.length_mm)};
  }
  if (place.path <= model.markers.paths && place.ring <= model.markers.rings())
    return std::pair(model.PathAngle(place.path - 1),
                     model.markers.rings_z_mm[static_cast<size_t>(place.ring - 1)]);
  return Error{ErrorCode::kInvalidArgument, where + ": marker (" + std::to_string(place.path) + ", " +
                                                std::to_string(place.ring) + ") is not on model '" +
                                                model.name + "', which has " +
                                                std::to_string(model.markers.paths) + " paths and " +
                                                std::to_string(model.markers.rings()) + " rings"};
}

}  // namespace

Result<std::unique_ptr<SimulatedSkin>> SimulatedSkin::Make(const LinkModel& model, const Scene& scene) {
  return Make(model, scene, std::make_shared<const LinearShell>(model, kSimulatedRefinement));
}

Result<std::unique_ptr<SimulatedSkin>> SimulatedSkin::Make(const LinkModel& model, const Scene& scene,
                                                           std::shared_ptr<const LinearShell> shell) {
  if (scene.contacts.size() > kMaxSceneContacts || scene.pressure.empty())
    return Error{ErrorCode::kInvalidArgument,
                 "scene '" + scene.name + "': too many contacts, or no pressure"};
  std::vector<SkinContact> contacts;
  contacts.reserve(scene.contacts.size());
  for (const SceneContact& plan : scene.contacts) {
    const auto from = Locate(model, plan.at, plan.where);
    if (!from) return from.error();
    const auto to = Locate(model, plan.move_to.value_or(plan.at), plan.where);
    if (!to) return to.error();
    SkinContact contact;
    contact.from = {from->first, from->second};
    contact.to = {to->first, to->second};
    contact.moves = plan.move_to.has_value();
    contacts.push_back(std::move(contact));
  }
  return std::unique_ptr<SimulatedSkin>(
      new SimulatedSkin(model, scene, std::move(shell), std::move(contacts)));
}

SimulatedSkin::SimulatedSkin(const LinkModel& model, const Scene& scene,
                             std::shared_ptr<const LinearShell> shell, std::vector<SkinContact> contacts)
    : model_(model),
      scene_(scene),
      shell_(std::move(shell)),
      finder_(model, shell_->mesh()),
      per_pressure_(Flat(shell_->PerPressure())),
      response_of_node_(static_cast<size_t>(mesh().node_count()), -1),
      contacts_(std::move(contacts)),
      pressed_(State::Zero(per_pressure_.size())),
      state_(pressed_) {
  for (size_t i = 0; i < mesh().mid_mm.size(); ++i) {
    const Vec3& p = mesh().mid_mm[i];
    radial_.push_back(Vec3(p.x(), p.y(), 0).normalized());
    const Vec3 wall = p - model_.thickness_mm / 2 * mesh().normals[i];
    rest_wall_radius_mm_.push_back(wall.head<2>().norm());
  }
  active_.reserve(contacts_.size());
  for (size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].patch.reserve(response_of_node_.size());
    contacts_[i].center.reserve(4);
    contacts_[i].response = State::Zero(state_.size());
    Place(contacts_[i], scene_.contacts[i].begin_s, scene_.contacts[i]);
    LearnResponses(contacts_[i], scene_.contacts[i].patch_diameter_mm);
  }
}

// A contact that stays needs the response to its load; one that moves, those to every node it will load.
void SimulatedSkin::LearnResponses(SkinContact& contact, double diameter_mm) {
  if (!contact.moves) {
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
    finder_.AtPatch(contact.from.angle_rad + share * (contact.to.angle_rad - contact.from.angle_rad),
                    contact.from.z_mm + share * (contact.to.z_mm - contact.from.z_mm), generous_mm, weights);
    for (const NodeWeight& w : weights) {
      const auto node = static_cast<size_t>(w.node);
      if (response_of_node_[node] >= 0) continue;
      response_of_node_[node] = static_cast<int>(unit_responses_.size());
      const NodalLoad load{w.node, -Normal(w.node)};
      unit_responses_.push_back(Flat(shell_->Solve({&load, 1})));
    }
  }
}

void SimulatedSkin::Place(SkinContact& contact, double time_s, const SceneContact& plan) {
  const double share = std::clamp((time_s - plan.begin_s) / (plan.end_s - plan.begin_s), 0.0, 1.0);
  contact.spot = {contact.from.angle_rad + share * (contact.to.angle_rad - contact.from.angle_rad),
                  contact.from.z_mm + share * (contact.to.z_mm - contact.from.z_mm)};
  finder_.AtPatch(contact.spot.angle_rad, contact.spot.z_mm, plan.patch_diameter_mm, contact.patch);
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

void SimulatedSkin::Evaluate(double time_s, SkinTruth& truth) {
  truth.time_s = time_s;
  truth.frame = static_cast<uint64_t>(std::max(0.0, std::round(time_s * scene_.frame_rate_hz)));
  const double t = scene_.loop ? std::fmod(time_s, scene_.duration_s) : std::min(time_s, scene_.duration_s);
  truth.pressure_mpa = scene_.PressureKpa(t) * kMpaPerKpa;
  active_.clear();
  for (size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].level = RampLevel(scene_.contacts[i], t);
    if (contacts_[i].level <= 0) continue;
    if (contacts_[i].moves) Place(contacts_[i], t, scene_.contacts[i]);
    active_.push_back(i);
  }
  state_ = truth.pressure_mpa * per_pressure_;
  ContactForces forces = Forces(truth.pressure_mpa);
  pressed_.setZero();
  for (size_t k = 0; k < active_.size(); ++k) pressed_ += forces[k].force_n * contacts_[active_[k]].response;
  const double scale = active_.empty() ? 1 : FreeScale(state_, pressed_);
  state_ += scale * pressed_;
  WriteWall(truth);
  WriteMarkers(truth);
  truth.contacts.clear();
  truth.total_force_n.setZero();
  for (size_t k = 0; k < active_.size(); ++k) {
    forces[k].force_n *= scale;
    forces[k].limited = forces[k].limited || scale < 1;
    WriteContact(active_[k], forces[k], truth);
  }
}

ContactForces SimulatedSkin::Forces(double pressure_mpa) {
  const auto n = static_cast<Eigen::Index>(active_.size());
  ContactMatrix compliance(n, n);
  ContactVector free_depth(n);
  ContactDemands demands;
  const double nearest =
      model_.tube_outer_radius_mm > 0 ? model_.tube_outer_radius_mm + kTubeGapMm : kNoTubeMm;
  for (Eigen::Index i = 0; i < n; ++i) {
    const size_t index = active_[static_cast<size_t>(i)];
    const SkinContact& contact = contacts_[index];
    const SceneContact& plan = scene_.contacts[index];
    free_depth(i) = pressure_mpa * InwardDepth(per_pressure_, contact);
    for (Eigen::Index j = 0; j < n; ++j)
      compliance(i, j) = InwardDepth(contacts_[active_[static_cast<size_t>(j)]].response, contact);
    double wall = 0;
    for (const NodeWeight& w : contact.center)
      wall += w.weight * rest_wall_radius_mm_[static_cast<size_t>(w.node)];
    demands[static_cast<size_t>(i)] = {plan.depth_mm.has_value(), contact.level * plan.force_n.value_or(0),
                                       plan.depth_mm.value_or(0), contact.level, wall - nearest};
  }
  return BalanceContacts(demands, compliance, free_depth);
}

// The largest share of the contacts' deformation, at most 1, that keeps every node's wall outside the tube.
double SimulatedSkin::FreeScale(const State& without, const State& contacts) const {
  const double nearest = model_.tube_outer_radius_mm > 0 ? model_.tube_outer_radius_mm : kNoTubeMm / 2;
  double scale = 1;
  for (int node = 0; node < mesh().node_count(); ++node) {
    const auto i = static_cast<size_t>(node);
    // Along the node's own radius; the wall turns little where a dent is deepest.
    const double before = rest_wall_radius_mm_[i] + radial_[i].dot(Shift(without, node));
    const double inward = -radial_[i].dot(Shift(contacts, node));
    if (inward > 0 && before - scale * inward < nearest) scale = std::max(0.0, (before - nearest) / inward);
  }
  return scale;
}

double SimulatedSkin::InwardDepth(const State& state, const SkinContact& contact) const {
  double depth = 0;
  for (const NodeWeight& w : contact.center) depth -= w.weight * Normal(w.node).dot(Shift(state, w.node));
  return depth;
}

Vec3 SimulatedSkin::Director(int node) const {
  const Vec3& rest = mesh().normals[static_cast<size_t>(node)];
  const Vec3 rotation = state_.segment<3>(Eigen::Index{3} * (mesh().node_count() + node));
  return rest + rotation.cross(rest);
}

void SimulatedSkin::WriteWall(SkinTruth& truth) const {
  RadiusGrid& wall = truth.inner_wall;
  wall.columns = mesh().columns;
  wall.first_angle_rad = model_.markers.first_path_angle_rad;
  wall.radius_mm.resize(mesh().mid_mm.size());
  wall.z_mm.resize(static_cast<size_t>(mesh().rows));
  wall.row_min_mm.assign(static_cast<size_t>(mesh().rows), 1e9);
  wall.largest_inward_change_mm = 0;
  for (int node = 0; node < mesh().node_count(); ++node) {
    const auto i = static_cast<size_t>(node), row = static_cast<size_t>(mesh().Row(node));
    const Vec3 p = mesh().mid_mm[i] + Shift(state_, node) - model_.thickness_mm / 2 * Director(node);
    wall.radius_mm[i] = p.head<2>().norm();
    wall.z_mm[row] = mesh().mid_mm[i].z() - model_.thickness_mm / 2 * mesh().normals[i].z();
    wall.row_min_mm[row] = std::min(wall.row_min_mm[row], wall.radius_mm[i]);
    wall.largest_inward_change_mm =
        std::max(wall.largest_inward_change_mm, rest_wall_radius_mm_[i] - wall.radius_mm[i]);
  }
}

void SimulatedSkin::WriteMarkers(SkinTruth& truth) const {
  const auto count = static_cast<size_t>(model_.markers.count());
  truth.marker_mm.resize(count);
  truth.marker_wall_mm.resize(count);
  truth.marker_normal.resize(count);
  const double half = model_.thickness_mm / 2;
  for (size_t m = 0; m < count; ++m) {
    const int node = mesh().NodeOfMarker(model_, static_cast<int>(m));
    const Vec3 mid = mesh().mid_mm[static_cast<size_t>(node)] + Shift(state_, node);
    const Vec3 director = Director(node);
    truth.marker_mm[m] = mid + (half - model_.markers.center_depth_mm) * director;
    truth.marker_wall_mm[m] = mid - half * director;
    truth.marker_normal[m] = director.normalized();
  }
}

void SimulatedSkin::WriteContact(size_t index, ContactForce force, SkinTruth& truth) const {
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
